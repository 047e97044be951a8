"""Messages in words, for people."""

from gesture_bot.msg import Constraint


def constraint_in_words(constraint: Constraint) -> str:
    """Such as `left wrist height at least the 85th percentile`."""
    quantity = constraint.quantity.replace("_", " ")
    value = f"{constraint.value:g} percentile" if constraint.unit == Constraint.PERCENTILE else f"{constraint.value:g}"
    return f"{constraint.hand} {quantity} {constraint.bound.replace('_', ' ')} {value}"
