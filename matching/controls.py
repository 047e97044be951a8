"""Motion controls: constraints on quantities, and the mask of frames that keep them (MM22)."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.frames import WINDOW
from gesture_bot.corpus.database import SEQUENCE, Database
from gesture_bot.matching.quantities import UNITS, Quantity, measure
from gesture_bot.matching.search import POSITIONS, eligible

Hand = Literal["left", "right", "both"]
Bound = Literal["at_least", "at_most"]
Unit = Literal["value", "percentile"]

FEWEST = 5
"""Sequences that the constraints must leave to choose from; with fewer, the robot would repeat itself."""


@dataclass(frozen=True)
class Constraint:
    """A bound on one quantity.

    Attributes:
        quantity: What is bounded; see quantities.py.
        hand: Whose; with `both`, the two hands keep the bound at once.
        bound: On which side of the threshold the quantity stays.
        value: The threshold: in the quantity's unit [m, m/s], or a percentile of the database, 0 to 100.
        unit: Which of the two `value` is.

    Raises:
        InvalidValueError: A name is unknown, or the value is not finite or no percentile.
    """

    # In config/emotions.yaml an unknown key is a mistake.
    __pydantic_config__ = {"extra": "forbid"}

    quantity: Quantity
    hand: Hand
    bound: Bound
    value: float
    unit: Unit = "percentile"

    def __post_init__(self) -> None:
        for name, kind in (("quantity", Quantity), ("hand", Hand), ("bound", Bound), ("unit", Unit)):
            if getattr(self, name) not in get_args(kind):
                raise InvalidValueError(f"unknown {name} of a control", getattr(self, name), get_args(kind))
        if not math.isfinite(self.value):
            raise InvalidValueError(f"value of a control on {self.quantity}", self.value, ["a finite number"])
        if self.unit == "percentile" and not 0 <= self.value <= 100:
            raise InvalidValueError(f"percentile of a control on {self.quantity}", self.value, ["0 to 100"])

    def __str__(self) -> str:
        threshold = (
            f"percentile {self.value:g}"
            if self.unit == "percentile"
            else f"{self.value:g} {UNITS[self.quantity]}"
        )
        return f"{self.hand} {self.quantity} {self.bound.replace('_', ' ')} {threshold}"


@dataclass(frozen=True)
class Admission:
    """The frames that some constraints admit.

    Attributes:
        mask: (S, 64) bool control mask.
        share: Share of all windows of the database that are eligible under it.
        relaxed: What had to give way, in words; empty where everything is kept.
    """

    mask: np.ndarray
    share: float
    relaxed: tuple[str, ...]


@dataclass(frozen=True)
class _Demand:
    """What may have to give way: its name, the frames (S, 64) that meet it, and what can be loosened."""

    name: str
    mask: np.ndarray
    constraint: Constraint | None = None


class Controls:
    """A database measured once, so that constraints become masks at any moment."""

    def __init__(self, database: Database) -> None:
        self._quantities = measure(database)
        self._emotion, self._emotions = database.emotion, database.emotions

    def _values(self, quantity: Quantity, hand: Hand, bound: Bound) -> np.ndarray:
        """(S, 64) the number that decides: of both hands, the one that has more to do."""
        values = self._quantities[quantity]
        if hand == "both":
            return values.min(axis=-1) if bound == "at_least" else values.max(axis=-1)
        return values[..., 0 if hand == "left" else 1]

    def threshold(self, constraint: Constraint) -> float:
        """The constraint's threshold in the unit of its quantity [m, m/s]."""
        if constraint.unit == "value":
            return constraint.value
        values = self._values(constraint.quantity, constraint.hand, constraint.bound)
        return float(np.percentile(values, constraint.value))

    def mask(self, constraint: Constraint) -> np.ndarray:
        """(S, 64) bool: the frames that keep one constraint."""
        values = self._values(constraint.quantity, constraint.hand, constraint.bound)
        threshold = self.threshold(constraint)
        return values >= threshold if constraint.bound == "at_least" else values <= threshold

    def labelled(self, labels: Sequence[str]) -> np.ndarray | None:
        """(S, 64) bool: the frames of sequences with one of these emotions; None where there are none."""
        known = [self._emotions.index(label) for label in labels if label in self._emotions]
        chosen = np.isin(self._emotion, known)
        return np.repeat(chosen[:, None], SEQUENCE, axis=1) if chosen.any() else None

    def admit(
        self,
        constraints: Sequence[Constraint],
        labels: Sequence[str] = (),
        weaker: Sequence[Constraint] = (),
    ) -> Admission:
        """The frames that keep all constraints, or as many of them as leave enough to choose from.

        Where fewer than FEWEST sequences have an eligible window, the last of the demands gives way first:
        it moves to the nearest percentile that leaves so many, or is dropped where even without it there are
        too few, and the one before it is next.

        Args:
            constraints: The strongest demands, the first one strongest of all.
            labels: Emotions to draw from, next in strength; nothing where the database has none of them.
            weaker: Demands that give way before the labels do.
        """
        demands = [_Demand(str(constraint), self.mask(constraint), constraint) for constraint in constraints]
        labelled = self.labelled(labels)
        if labelled is not None:
            demands.append(_Demand(f"emotion {' or '.join(labels)}", labelled))
        demands += [_Demand(str(constraint), self.mask(constraint), constraint) for constraint in weaker]

        relaxed: list[str] = []
        while self._too_few(mask := self._kept(demands)):
            weakest = demands.pop()
            rest = self._kept(demands)
            if weakest.constraint is None or self._too_few(rest):
                relaxed.append(f"{weakest.name}: dropped")
                continue
            percentile, mask = self._nearest(weakest.constraint, rest)
            relaxed.append(f"{weakest.name}: relaxed to percentile {percentile:.1f}")
            break
        return Admission(mask, float(eligible(mask).mean()), tuple(relaxed))

    def _kept(self, demands: Sequence[_Demand]) -> np.ndarray:
        everything = np.ones((len(self._emotion), SEQUENCE), bool)
        return np.logical_and.reduce([everything, *(demand.mask for demand in demands)])

    def _too_few(self, mask: np.ndarray) -> bool:
        sequences = int(eligible(mask).any(axis=1).sum())
        return sequences < min(FEWEST, len(mask))

    def _nearest(self, constraint: Constraint, rest: np.ndarray) -> tuple[float, np.ndarray]:
        """The percentile nearest to a constraint's at which FEWEST sequences stay eligible, and the mask."""
        sign = 1 if constraint.bound == "at_least" else -1
        values = sign * self._values(constraint.quantity, constraint.hand, constraint.bound)
        # A window keeps a bound that both of its ends keep; a sequence, one that its best window keeps.
        windows = np.minimum(values[:, :POSITIONS], values[:, WINDOW - 1 :])
        best = np.where(eligible(rest), windows, -np.inf).max(axis=1)
        threshold = np.sort(best)[-min(FEWEST, len(best))]
        return 100 * float(np.mean(sign * values <= sign * threshold)), rest & (values >= threshold)
