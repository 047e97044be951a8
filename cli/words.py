"""Messages in words, for people."""

from gesture_bot.msg import Constraint


def constraint_in_words(constraint: Constraint) -> str:
    """Such as `left wrist height over p85`, the 85th percentile of the database, or `speaker Ann or Bob`."""
    quantity = constraint.quantity.replace("_", " ")
    if constraint.labels:
        return f"{quantity} {' or '.join(constraint.labels)}"
    sign = "over" if constraint.bound == "at_least" else "under"
    value = f"p{constraint.value:g}" if constraint.unit == "percentile" else f"{constraint.value:g}"
    hand = "" if constraint.hand == "both" else f"{constraint.hand} "
    return f"{hand}{quantity} {sign} {value}"
