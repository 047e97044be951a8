"""Between messages of constraints and those that the matching room works on."""

from collections.abc import Sequence

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.corpus.database import LABELS
from gesture_bot.matching.controls import Constraint, Demand, LabelConstraint
from gesture_bot.matching.quantities import QUANTITIES
from gesture_bot.msg import Constraint as ConstraintMessage


def constraint_from(message: ConstraintMessage) -> Demand:
    """A constraint on the motion.

    Raises:
        InvalidValueError: A name or number in it is not valid.
    """
    common = {"priority": message.priority, "duration": message.duration}
    if message.quantity in LABELS:
        return LabelConstraint(message.quantity, tuple(message.labels), **common)
    if message.quantity not in QUANTITIES:
        raise InvalidValueError("unknown quantity of a control", message.quantity, (*QUANTITIES, *LABELS))
    return Constraint(message.quantity, message.bound, message.value, message.hand, message.unit, **common)


def bounds_from(messages: Sequence[ConstraintMessage]) -> list[Constraint]:
    """Those constraints that are bounds.

    Raises:
        InvalidValueError: See constraint_from.
    """
    demands = [constraint_from(message) for message in messages]
    return [demand for demand in demands if isinstance(demand, Constraint)]


def constraint_to(constraint: Demand) -> ConstraintMessage:
    """The message of a constraint on the motion."""
    message = ConstraintMessage(priority=constraint.priority, duration=constraint.duration)
    if isinstance(constraint, LabelConstraint):
        message.quantity, message.labels = constraint.kind, list(constraint.names)
    elif isinstance(constraint, Constraint):
        message.quantity, message.hand, message.bound = constraint.quantity, constraint.hand, constraint.bound
        message.value, message.unit = constraint.value, constraint.unit
    return message
