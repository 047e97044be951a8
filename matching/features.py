"""What the search compares: z-scored poses and sounds, stacked over the frames to come (MM22)."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from gesture_bot.base.keypoints import INDEX, MATCHED
from gesture_bot.speech.features import STATIC

POSE_OFFSETS = np.arange(0, 8, 2)
"""Frames that a pose feature stacks: t, t+2, t+4, t+6."""

AUDIO_OFFSETS = np.arange(0, 16, 2)
"""Frames that an audio feature stacks: t, t+2, ..., t+14."""

_MATCHED = [INDEX[name] for name in MATCHED]


@dataclass(frozen=True)
class ZScore:
    """Mean and standard deviation of each number of a frame, over a database."""

    mean: np.ndarray
    deviation: np.ndarray

    @classmethod
    def of(cls, frames: np.ndarray) -> Self:
        """Statistics of (n, d) frames. A number that never changes keeps its unit."""
        deviation = frames.std(axis=0)
        return cls(frames.mean(axis=0), np.where(deviation > 0, deviation, 1.0))

    def __call__(self, frames: np.ndarray) -> np.ndarray:
        """(..., d) frames in standard deviations from the mean."""
        return (frames - self.mean) / self.deviation


def pose_frames(keypoints: np.ndarray) -> np.ndarray:
    """Positions of the 8 matched keypoints, before z-scoring: (n, 17, 3) -> (n, 24) float64 [m]."""
    return keypoints[:, _MATCHED].reshape(len(keypoints), -1).astype(np.float64)


def audio_frames(features: np.ndarray) -> np.ndarray:
    """13 MFCC and the log mean energy of speech features, before z-scoring: (n, 28) -> (n, 14) float64."""
    return features[:, :STATIC].astype(np.float64)


def stack(frames: np.ndarray, rows: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """Matching features at some frames; the last frame is held beyond the end.

    Args:
        frames: (n, d) z-scored frames, in the order of time.
        rows: (r,) frames at which the features begin.
        offsets: (o,) frames to stack, counted from each row.

    Returns:
        (r, o * d).
    """
    stacked = np.minimum(rows[:, None] + offsets, len(frames) - 1)
    return frames.take(stacked, axis=0).reshape(len(rows), len(offsets) * frames.shape[1])
