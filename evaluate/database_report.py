"""What a gesture database holds, in numbers."""

from dataclasses import dataclass

import numpy as np

from gesture_bot.base.frames import FRAME_RATE
from gesture_bot.corpus.database import LABELS, SEQUENCE, Database
from gesture_bot.matching.quantities import Quantity, measure

DRAWN: dict[str, tuple[Quantity, str]] = {
    "wrist height over the pelvis": ("wrist_height", "cm"),
    "wrist speed": ("wrist_speed", "cm/s"),
    "hand radius": ("hand_radius", "cm"),
}
"""What is shown of each hand, by what people call it: the quantity, and the unit that it is shown in."""


@dataclass(frozen=True)
class DatabaseReport:
    """Figures of a database.

    Attributes:
        hours: Motion in its sequences; frames that two of them share count once [h].
        recordings: How many.
        sequences: How many.
        labels: Sequences by kind of label and name, "" being none.
        quantities: (2, n) values of the left and the right hand on each frame of the sequences [m, m/s].
    """

    hours: float
    recordings: int
    sequences: int
    labels: dict[str, dict[str, int]]
    quantities: dict[Quantity, np.ndarray]

    @property
    def duration(self) -> str:
        """The hours in words."""
        return f"{self.hours:.1f} hours" if self.hours >= 1 else f"{60 * self.hours:.1f} minutes"


def database_report(database: Database) -> DatabaseReport:
    """Count and measure a database."""
    frames = frames_of(database)
    measured = measure(database)
    return DatabaseReport(
        hours=len(frames) / FRAME_RATE / 3600,
        recordings=len(np.unique(database.recording)),
        sequences=len(database.starts),
        labels={kind: _counts(database, kind) for kind in LABELS},
        quantities={quantity: measured[quantity][:, frames] for quantity, _ in DRAWN.values()},
    )


def frames_of(database: Database) -> np.ndarray:
    """The frames that lie in a sequence, in order."""
    return np.unique(database.starts[:, None] + np.arange(SEQUENCE))


def _counts(database: Database, kind: str) -> dict[str, int]:
    indices = database.labels[:, LABELS.index(kind)]
    counts = {name: int(np.sum(indices == index)) for index, name in enumerate(database.names[kind])}
    unlabelled = int(np.sum(indices < 0))
    return counts | ({"": unlabelled} if unlabelled else {})
