"""Messages in words, for people."""

from gesture_bot.msg import Constraint


def constraint_in_words(constraint: Constraint) -> str:
    """Such as `left wrist height over p85`, the 85th percentile of the database."""
    quantity = constraint.quantity.replace("_", " ")
    sign = "over" if constraint.bound == "at_least" else "under"
    value = f"p{constraint.value:g}" if constraint.unit == "percentile" else f"{constraint.value:g}"
    return f"{constraint.hand} {quantity} {sign} {value}"
