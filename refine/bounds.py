"""The bounds that the controls set, as the network takes them: one threshold a quantity, hand and side."""

from collections.abc import Sequence
from typing import get_args

import numpy as np

from gesture_bot.corpus.database import Database
from gesture_bot.matching.controls import Bound, Constraint, Hand
from gesture_bot.matching.quantities import QUANTITIES, TWO_HANDED, Quantity, measure

_HANDS: tuple[Hand, ...] = ("left", "right")

MEASURED: tuple[tuple[Quantity, Hand], ...] = tuple(
    (quantity, hand)
    for quantity in QUANTITIES
    for hand in (get_args(Hand)[-1:] if quantity in TWO_HANDED else _HANDS)
)
"""The 8 numbers that are measured on a frame."""

BOUNDS = len(get_args(Bound)) * len(MEASURED)
"""How many bounds there can be: first `at_least` of each number, then `at_most`."""


def measured(database: Database) -> np.ndarray:
    """The numbers of MEASURED on every frame of a database: (N, 8) float32 [m, m/s]."""
    return np.concatenate(list(measure(database).values())).T


def bounds_of(kept: Sequence[Constraint]) -> np.ndarray:
    """Thresholds of constraints whose unit is `value`: (16,) [m, m/s], NaN where there is none.

    Of two on the same number and side, the tighter one holds.
    """
    least, most = np.full((2, len(MEASURED)), np.nan)
    for constraint in kept:
        hands = get_args(Hand) if constraint.hand == "both" else (constraint.hand,)
        side, tighter = (least, np.fmax) if constraint.bound == "at_least" else (most, np.fmin)
        for place, (quantity, hand) in enumerate(MEASURED):
            if quantity == constraint.quantity and hand in hands:
                side[place] = tighter(side[place], constraint.value)
    return np.concatenate([least, most])


def constraints_of(bounds: np.ndarray) -> list[Constraint]:
    """Thresholds (16,) as constraints."""
    return [
        Constraint(quantity, bound, float(value), hand, "value")
        for (bound, quantity, hand), value in zip(
            ((bound, *number) for bound in get_args(Bound) for number in MEASURED), bounds, strict=True
        )
        if np.isfinite(value)
    ]
