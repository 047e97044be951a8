"""Motion controls: constraints on the motion, and the mask of frames that keep them (MM22)."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.frames import WINDOW
from gesture_bot.corpus.database import LABELS, SEQUENCE, Database
from gesture_bot.matching.quantities import TWO_HANDED, UNITS, Quantity, measure
from gesture_bot.matching.search import MAX_K, POSITIONS, eligible

Hand = Literal["left", "right", "both"]
Bound = Literal["at_least", "at_most"]
Unit = Literal["percentile", "value"]

FEWEST = 5
"""Sequences that the constraints must leave to choose from; with fewer, the robot would repeat itself."""

ROOM = MAX_K
"""Sequences that a constraint leaves once it has given way, or half of all in a small database.

With FEWEST alone, at the end of what people do, the robot would stand still for seconds while it speaks.
"""


AROUND = WINDOW // 2
"""Where a window has begun lately, none begins or ends up to so many frames before or after."""


@dataclass(frozen=True, kw_only=True)
class Demand:
    """What every constraint has.

    Attributes:
        priority: Where too little motion keeps all constraints, the lowest gives way first; of equal ones,
            the later.
        duration: It ends so long after it was asked for [s]; 0: when others are asked for.

    Raises:
        InvalidValueError: The duration is negative or not a number.
    """

    priority: int = 0
    duration: float = 0.0

    def __post_init__(self) -> None:
        if not self.duration >= 0:
            raise InvalidValueError(f"duration of the control {self}", self.duration, ["0 s or more"])

    def holds(self, since: float, now: float) -> bool:
        """Whether it has not ended, when it was asked for at a moment [s since the epoch]."""
        return self.duration == 0 or now < since + self.duration


@dataclass(frozen=True)
class Constraint(Demand):
    """A bound on one quantity.

    Attributes:
        quantity: What is bounded; see quantities.py.
        bound: On which side of the threshold the quantity stays.
        value: The threshold: a percentile of the database's frames, or a number [m, m/s].
        hand: Whose quantity; with `both`, each hand keeps the bound, or both together have the quantity.
        unit: Which of the two `value` is.

    Raises:
        InvalidValueError: A name is unknown, the value is not finite or no percentile, or one hand is asked
            of a quantity that both have together.
    """

    # In config/emotions.yaml an unknown key is a mistake.
    __pydantic_config__ = {"extra": "forbid"}

    quantity: Quantity
    bound: Bound
    value: float
    hand: Hand = "both"
    unit: Unit = "percentile"

    def __post_init__(self) -> None:
        for name, kind in (("quantity", Quantity), ("bound", Bound), ("hand", Hand), ("unit", Unit)):
            if getattr(self, name) not in get_args(kind):
                raise InvalidValueError(f"unknown {name} of a control", getattr(self, name), get_args(kind))
        if self.quantity in TWO_HANDED and self.hand != "both":
            raise InvalidValueError(f"hand of a control on {self.quantity}", self.hand, ["both"])
        if not math.isfinite(self.value):
            raise InvalidValueError(f"value of a control on {self.quantity}", self.value, ["a finite number"])
        if self.unit == "percentile" and not 0 <= self.value <= 100:
            raise InvalidValueError(f"percentile of a control on {self.quantity}", self.value, ["0 to 100"])
        super().__post_init__()

    def __str__(self) -> str:
        hand = "" if self.quantity in TWO_HANDED else f"{self.hand} "
        unit = f" {UNITS[self.quantity]}" if self.unit == "value" else ""
        percentile = "percentile " if self.unit == "percentile" else ""
        return f"{hand}{self.quantity} {self.bound.replace('_', ' ')} {percentile}{self.value:g}{unit}"


@dataclass(frozen=True)
class LabelConstraint(Demand):
    """A choice of recordings by their label.

    Attributes:
        kind: Of the label, one of database.LABELS.
        names: The labels to choose from, one or more.

    Raises:
        InvalidValueError: The kind is unknown, or there is no name.
    """

    kind: str
    names: tuple[str, ...]

    def __post_init__(self) -> None:
        if self.kind not in LABELS:
            raise InvalidValueError("unknown kind of label", self.kind, LABELS)
        if not self.names:
            raise InvalidValueError(f"labels of a control on {self.kind}", [], ["one or more names"])
        super().__post_init__()

    def __str__(self) -> str:
        return f"{self.kind} {' or '.join(self.names)}"


@dataclass(frozen=True)
class Admission:
    """The frames that some constraints admit.

    Attributes:
        mask: (S, 64) bool control mask.
        sequences: Sequences that have an eligible window under it.
        share: Share of all windows of the database that are eligible.
        relaxed: What had to give way, in words; empty where everything is kept.
        kept: The bounds as they are kept, with thresholds in the units of their quantities.
    """

    mask: np.ndarray
    sequences: int
    share: float
    relaxed: tuple[str, ...]
    kept: tuple[Constraint, ...]

    def without(self, shown: Iterable[tuple[int, int]]) -> np.ndarray:
        """The mask without windows that were shown, as long as MAX_K sequences stay eligible.

        MM22 lets windows come back at once. Where constraints leave few, the search then goes round among
        those that join best.

        Args:
            shown: Sequence and first frame of each window; the first ones count most.
        """
        mask, left = self.mask.copy(), self.sequences
        for sequence, frame in shown:
            row = mask[sequence : sequence + 1]
            fresh = row.copy()
            fresh[:, max(0, frame - AROUND) : frame + AROUND + 1] = False
            left -= _sequences(row) - _sequences(fresh)
            if left < MAX_K:
                break
            row[:] = fresh
        return mask


class Controls:
    """A database measured once, so that constraints become masks at any moment."""

    def __init__(self, database: Database) -> None:
        self._database = database
        self._quantities = measure(database)
        self._thresholds: dict[tuple[Quantity, Hand, Bound, float], float] = {}

    def check(self, demands: Sequence[Demand]) -> None:
        """Raise an InvalidValueError, which lists the known ones, where the database lacks a label."""
        for demand in demands:
            if isinstance(demand, LabelConstraint):
                for name in demand.names:
                    self._database.labelled(demand.kind, name)

    def threshold(self, constraint: Constraint) -> float:
        """The constraint's threshold in the unit of its quantity [m, m/s]."""
        if constraint.unit == "value":
            return constraint.value
        key = constraint.quantity, constraint.hand, constraint.bound, constraint.value
        if key not in self._thresholds:
            self._thresholds[key] = float(np.percentile(self._values(constraint), constraint.value))
        return self._thresholds[key]

    def mask(self, demand: Demand) -> np.ndarray:
        """(S, 64) bool: the frames that keep one constraint.

        Raises:
            InvalidValueError: The database lacks a label.
        """
        if isinstance(demand, Constraint):
            values, threshold = self._hands(demand), self.threshold(demand)
            kept = values >= threshold if demand.bound == "at_least" else values <= threshold
            return self._in_sequences(np.logical_and.reduce(kept))
        assert isinstance(demand, LabelConstraint)
        chosen = np.zeros(len(self._database.starts), bool)
        for name in demand.names:
            chosen |= self._database.labelled(demand.kind, name)
        return np.repeat(chosen[:, None], SEQUENCE, axis=1)

    def admit(
        self, demands: Sequence[Demand], background: Sequence[Demand] = (), among: np.ndarray | None = None
    ) -> Admission:
        """The frames that keep all constraints, or as much of them as leaves enough to choose from.

        The constraints are taken by priority, the highest first. One that would leave fewer than FEWEST
        sequences with an eligible window moves to the nearest percentile that leaves ROOM. A label that
        leaves fewer is dropped.

        Args:
            demands: What was asked for.
            background: What gives way before any of it: an emotion.
            among: (S,) bool: the sequences that may be chosen at all.
        """
        mask = np.ones((len(self._database.starts), SEQUENCE), bool)
        if among is not None:
            mask &= among[:, None]
        relaxed, kept = [], []
        for demand in (*_strongest_first(demands), *_strongest_first(background)):
            wanted = mask & self.mask(demand)
            if _sequences(wanted) >= min(FEWEST, len(mask)):
                mask = wanted
                if isinstance(demand, Constraint):
                    kept.append(replace(demand, value=self.threshold(demand), unit="value"))
            elif isinstance(demand, Constraint):
                percentile, threshold, mask = self._nearest(demand, mask)
                unit = UNITS[demand.quantity]
                relaxed.append(f"{demand}: relaxed to {threshold:.2f} {unit}, percentile {percentile:.1f}")
                kept.append(replace(demand, value=threshold, unit="value"))
            else:
                relaxed.append(f"{demand}: dropped")
        return Admission(mask, _sequences(mask), float(eligible(mask).mean()), tuple(relaxed), tuple(kept))

    def _hands(self, constraint: Constraint) -> np.ndarray:
        """(1 or 2, N) the quantity of the hands that a constraint bounds."""
        values = self._quantities[constraint.quantity]
        return {"left": values[:1], "right": values[1:], "both": values}[constraint.hand]

    def _values(self, constraint: Constraint) -> np.ndarray:
        """(S, 64) the number that decides: of both hands, the one that has more to do."""
        most = np.minimum if constraint.bound == "at_least" else np.maximum
        return self._in_sequences(most.reduce(self._hands(constraint)))

    def _in_sequences(self, frames: np.ndarray) -> np.ndarray:
        """(S, 64) what the frames (N,) of each sequence have."""
        return np.lib.stride_tricks.sliding_window_view(frames, SEQUENCE)[self._database.starts]

    def _nearest(self, constraint: Constraint, rest: np.ndarray) -> tuple[float, float, np.ndarray]:
        """The percentile nearest to a constraint's at which ROOM sequences stay eligible, or all that are.

        Then the quantity there, and the mask.
        """
        sign = 1 if constraint.bound == "at_least" else -1
        values = sign * self._values(constraint)
        # A window keeps a bound that both of its ends keep; a sequence, one that its best window keeps.
        windows = np.minimum(values[:, :POSITIONS], values[:, WINDOW - 1 :])
        best = np.where(eligible(rest), windows, -np.inf).max(axis=1)
        room = min(ROOM, max(FEWEST, len(best) // 2), int(np.isfinite(best).sum()))
        threshold = np.sort(best)[-room]
        percentile = 100 * float(np.mean(sign * values <= sign * threshold))
        return percentile, float(sign * threshold), rest & (values >= threshold)


def _strongest_first(demands: Sequence[Demand]) -> list[Demand]:
    return sorted(demands, key=lambda demand: -demand.priority)


def _sequences(mask: np.ndarray) -> int:
    """How many sequences have an eligible window."""
    return int(eligible(mask).any(axis=1).sum())
