"""What a reader of recordings hands over: takes, as they stand in the file.

A reader is a module with KIND, `fits` and `read` (see Reader); corpus/readers.py lists them. Which
joint is which keypoint, where up is and what a file name says are matters of the skeleton map
(corpus/skeletons.py), so a reader knows nothing of them.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

import numpy as np


@dataclass(frozen=True)
class Take:
    """One uninterrupted recording, in the units and axes of its source.

    Attributes:
        name: Unique within its file; the file's stem where it holds one take.
        joints: Names of the j joints; numbers, "0" and up, where the source does not name them.
        positions: (n, j, 3) positions of one scale along all axes, NaN where tracking is lost.
        rate: Frames a second; None where the file does not say, and the skeleton map must.
        features: (m, 28) speech features at 15 frames a second from the first position on, where the file
            holds sound; see speech/features.py. None: the sound is a file of its own.
        labels: What the file itself says, by kind (database.LABELS).
    """

    name: str
    joints: tuple[str, ...]
    positions: np.ndarray
    rate: float | None
    features: np.ndarray | None = None
    labels: Mapping[str, str] = field(default_factory=dict)


class Reader(Protocol):
    """What a module that reads one kind of file defines.

    Attributes:
        KIND: What an error calls this kind of file, such as "BVH (.bvh)".
    """

    KIND: str

    def fits(self, path: Path) -> bool:
        """Whether a file is of this kind; a look at its name and, where that is not enough, at its start."""

    def read(self, path: Path) -> Iterator[Take]:
        """The takes of a file, in an order that never changes.

        Raises:
            FileFormatError: The file is damaged or is not what its name says.
        """
