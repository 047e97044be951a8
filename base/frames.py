"""The frame grid that every node shares: frame k is seen k/15 s after the epoch."""

import math
from dataclasses import dataclass

import numpy as np

FRAME_RATE = 15
"""Frames a second, of features and of keypoints (MM22)."""

WINDOW = 8
"""Frames from one search to the next, 533 ms (MM22)."""


def frame_time(frame: int) -> float:
    """The moment at which a frame is seen [s since the epoch]."""
    return frame / FRAME_RATE


def first_frame_after(seconds: float) -> int:
    """The first frame that is seen at or after a moment [s since the epoch]."""
    # A double since the epoch is good to a quarter of a microsecond: its own frame must not become the next.
    return math.ceil(seconds * FRAME_RATE - 1e-4)


@dataclass(frozen=True)
class KeypointClip:
    """Consecutive frames of keypoints. It replaces all that was planned from its first frame on.

    Attributes:
        start: Index of the first frame on the grid.
        keypoints: (n, 17, 3) positions [m], pelvis frame, x forward, y left, z up (REP-103).
    """

    start: int
    keypoints: np.ndarray

    @property
    def stop(self) -> int:
        """Index of the frame after the last."""
        return self.start + len(self.keypoints)
