"""Do the motion controls do what they say: MM22's table 2, for any database and speech."""

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np
from tqdm import tqdm

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.files import write_whole
from gesture_bot.base.frames import WINDOW
from gesture_bot.base.keypoints import WRISTS
from gesture_bot.corpus.database import Database
from gesture_bot.matching.controls import Constraint, Controls
from gesture_bot.matching.emotions import NEUTRAL
from gesture_bot.matching.quantities import MEASURES, measure
from gesture_bot.matching.search import eligible
from gesture_bot.matching.selector import Selector
from gesture_bot.refine.model import RefinementModel
from gesture_bot.refine.offline import spoken_motion
from gesture_bot.speech.streaming import SpeechFrame

CONTROLS = {
    "high": Constraint("wrist_height", "at_least", 85, "left"),
    "low": Constraint("wrist_height", "at_most", 15, "left"),
    "fast": Constraint("wrist_speed", "at_least", 85, "left"),
    "slow": Constraint("wrist_speed", "at_most", 15, "left"),
    "asymmetric": Constraint("wrist_asymmetry", "at_least", 85),
    "symmetric": Constraint("wrist_asymmetry", "at_most", 15),
    "wide": Constraint("hand_span", "at_least", 85),
    "narrow": Constraint("hand_span", "at_most", 15),
}
"""The controls of MM22's table 2 and, as two more, how far the hands are apart."""

NEAR = 0.1
"""A mean may miss its threshold by this share of it."""

LIVELY = 0.4
"""Least variation, as a share of that without a control: with less, the robot looks stuck."""


@dataclass(frozen=True)
class Spread:
    """Mean and standard deviation of a quantity [m or m/s]."""

    mean: float
    deviation: float

    @classmethod
    def of(cls, values: np.ndarray) -> Self:
        """Of numbers of any shape."""
        return cls(float(values.mean()), float(values.std()))

    def share_of(self, other: "Spread") -> float:
        """The deviation as a share of another; not a number where the other has none."""
        return self.deviation / other.deviation if other.deviation else float("nan")


@dataclass(frozen=True)
class Outcome:
    """A quantity in the motion to speech, under a control and without any.

    Attributes:
        controlled: Under the control.
        free: Without.
        hands: How far the wrists go from their mean places, as a share of how far they go without it.
        short: Mean over the frames of what is missing to the threshold, 0 for those that keep it [m or m/s].
    """

    controlled: Spread
    free: Spread
    hands: float
    short: float

    @property
    def variation(self) -> float:
        """The deviation as a share of that without the control."""
        return self.controlled.share_of(self.free)


@dataclass(frozen=True)
class Row:
    """What one control did.

    Attributes:
        name: Of the control.
        constraint: As the selector took it.
        threshold: In the quantity's unit [m or m/s].
        share: Share of the database's windows that it leaves.
        left: The quantity on all frames of these windows, from which the search chose.
        found: The windows that the search chose for speech, each by itself.
        refined: The motion that became of them, in the frames of speech.
        relaxed: How the control gave way, where too few windows keep it.
    """

    name: str
    constraint: Constraint
    threshold: float
    share: float
    left: Spread
    found: Outcome
    refined: Outcome
    relaxed: tuple[str, ...]

    def missed(self, outcome: Outcome) -> list[str]:
        """What does not hold of an outcome: its `mean`, its `variation`, or both."""
        over = outcome.controlled.mean - self.threshold
        kept = over if self.constraint.bound == "at_least" else -over
        holds = {"mean": kept >= -NEAR * abs(self.threshold), "variation": outcome.variation >= LIVELY}
        return [what for what, held in holds.items() if not held]


@dataclass(frozen=True)
class _Motion:
    """What the selector made of speech.

    Attributes:
        windows: Keypoints (8, 17, 3) of each window that the search chose.
        refined: (n, 17, 3) the motion after refinement, from begin to end.
        spoken: (n,) bool: the frames of it that come from these windows.
    """

    windows: list[np.ndarray]
    refined: np.ndarray
    spoken: np.ndarray

    def outcome(self, free: "_Motion", constraint: Constraint, threshold: float, refined: bool) -> Outcome:
        """What became of a constraint's quantity, beside a motion without it."""
        values = self.values(constraint, refined)
        missing = threshold - values if constraint.bound == "at_least" else values - threshold
        return Outcome(
            controlled=Spread.of(values),
            free=Spread.of(free.values(constraint, refined)),
            hands=self.reach(refined) / free.reach(refined),
            short=float(np.maximum(missing, 0).mean()),
        )

    def values(self, constraint: Constraint, refined: bool) -> np.ndarray:
        """The constraint's quantity on each frame of speech."""
        if refined:
            return _values(constraint, self.refined)[self.spoken]
        # Each window by itself: a jump to the next one is no speed of its own.
        return np.concatenate([_values(constraint, window) for window in self.windows])

    def reach(self, refined: bool) -> float:
        """How far the wrists go from their mean places [m]."""
        keypoints = self.refined[self.spoken] if refined else np.concatenate(self.windows)
        return float(np.sqrt(keypoints[:, WRISTS].var(axis=0).sum()))


def control_table(
    database: Database, speech: Sequence[SpeechFrame], model: RefinementModel | None = None
) -> list[Row]:
    """Make motion for speech under each of CONTROLS and without any, and measure it.

    Args:
        database: Where the motion comes from.
        speech: Its frames; see speech/streaming.py.
        model: The network that refines; without one, windows are smoothed.

    Raises:
        InvalidValueError: There is no speech, or nothing moves to it.
    """
    selector = Selector(database, gestures={}, emotions=NEUTRAL)
    controls, measured = Controls(database), measure(database)
    free = _motion(selector, speech, model)
    if free.reach(refined=False) == 0:
        raise InvalidValueError("no hand moves in the database: there is nothing to measure")
    rows = []
    for name, constraint in tqdm(CONTROLS.items(), "trying the controls", unit="control", disable=None):
        sequences, frames = np.nonzero(eligible(controls.admit([constraint]).mask))
        left = database.starts[sequences, None] + frames[:, None] + np.arange(WINDOW)
        selector = Selector(database, gestures={}, emotions=NEUTRAL)
        selector.set_controls([constraint])
        motion, threshold = _motion(selector, speech, model), controls.threshold(constraint)
        rows.append(
            Row(
                name=name,
                constraint=constraint,
                threshold=threshold,
                share=selector.eligible,
                left=Spread.of(measured[constraint.quantity][_hand(constraint)][left]),
                found=motion.outcome(free, constraint, threshold, refined=False),
                refined=motion.outcome(free, constraint, threshold, refined=True),
                relaxed=selector.relaxed,
            )
        )
    return rows


def _motion(selector: Selector, speech: Sequence[SpeechFrame], model: RefinementModel | None) -> _Motion:
    """Walk speech through search and refinement, as the nodes do."""
    motion = spoken_motion(selector, speech, model)
    return _Motion([window.keypoints for window in motion.windows], motion.refined.keypoints, motion.spoken)


def _values(constraint: Constraint, keypoints: np.ndarray) -> np.ndarray:
    """(n,) the constraint's quantity of a clip (n, 17, 3)."""
    return MEASURES[constraint.quantity](keypoints)[:, _hand(constraint)]


def _hand(constraint: Constraint) -> int:
    """The column of its hand; a quantity of both hands has one alone."""
    return 1 if constraint.hand == "right" else 0


def write_control_table(path: Path, rows: Sequence[Row]) -> None:
    """Write the table as CSV, a line a control, in SI units.

    Args:
        path: File to write.
        rows: The table.
    """
    lines = [_line(row) for row in rows]
    with write_whole(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, lines[0].keys())
        writer.writeheader()
        writer.writerows(lines)


def _line(row: Row) -> dict[str, object]:
    line: dict[str, object] = {
        "control": row.name,
        "constraint": str(row.constraint),
        "threshold": row.threshold,
        "share_of_windows": row.share,
        "relaxed": "; ".join(row.relaxed),
        "windows_left_mean": row.left.mean,
        "windows_left_deviation": row.left.deviation,
    }
    for stage, outcome in (("found", row.found), ("refined", row.refined)):
        line |= {
            f"{stage}_mean": outcome.controlled.mean,
            f"{stage}_deviation": outcome.controlled.deviation,
            f"{stage}_free_mean": outcome.free.mean,
            f"{stage}_free_deviation": outcome.free.deviation,
            f"{stage}_variation": outcome.variation,
            f"{stage}_hands": outcome.hands,
            f"{stage}_short": outcome.short,
            f"{stage}_missed": " and ".join(row.missed(outcome)),
        }
    return line
