"""What the search compares: z-scored poses and sounds, stacked over the frames to come (MM22)."""

import mmap
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gesture_bot.base.keypoints import INDEX, MATCHED
from gesture_bot.corpus.database import Database
from gesture_bot.speech.features import STATIC

POSE_OFFSETS = np.arange(0, 8, 2)
"""Frames that a pose feature stacks: t, t+2, t+4, t+6."""

AUDIO_OFFSETS = np.arange(0, 16, 2)
"""Frames that an audio feature stacks: t, t+2, ..., t+14."""


@dataclass(frozen=True)
class Stream:
    """Frames of pose or of sound, in the order of time, and how their features are made and compared.

    Attributes:
        frames: (n, m) float32 numbers of each frame, as they are stored.
        columns: Which d of the m numbers are compared.
        mean, deviation: (d,) statistics for z-scoring.
        offsets: (o,) frames that a feature stacks, counted from its row.
        distance: Of features (r, o * d) from a query (o * d,).
    """

    frames: np.ndarray
    columns: np.ndarray
    mean: np.ndarray
    deviation: np.ndarray
    offsets: np.ndarray
    distance: Callable[[np.ndarray, np.ndarray], np.ndarray]

    def z_scored(self, frames: np.ndarray) -> np.ndarray:
        """Frames (..., m) as (..., d) float64, in standard deviations from the mean."""
        return (frames[..., self.columns].astype(np.float64) - self.mean) / self.deviation

    def at(self, rows: np.ndarray) -> np.ndarray:
        """(r, o * d) features of rows (r,); the last frame is held beyond the end."""
        stacked = np.minimum(rows[:, None] + self.offsets, len(self.frames) - 1)
        return self.z_scored(self.frames[stacked]).reshape(len(rows), len(self.offsets) * len(self.columns))

    def of(self, frames: np.ndarray) -> np.ndarray:
        """(o * d,) feature of the first of some other frames (n, m); the last one is held."""
        stacked = np.minimum(self.offsets, len(frames) - 1)
        return self.z_scored(frames[stacked]).ravel()

    def release(self) -> None:
        """Give what has been read of a mapped file back to the system; it is read again when it is needed."""
        base: object = self.frames
        while isinstance(base, np.ndarray):
            base = base.base
        if isinstance(base, mmap.mmap):
            base.madvise(mmap.MADV_DONTNEED)


def poses(database: Database) -> Stream:
    """The 8 matched keypoints: 24 numbers a frame, 96 a feature, compared by Euclidean distance."""
    columns = np.concatenate([np.arange(3) + 3 * INDEX[name] for name in MATCHED])
    mean, deviation = database.keypoint_mean.ravel(), database.keypoint_deviation.ravel()
    frames = database.keypoints.reshape(len(database.keypoints), -1)
    return Stream(frames, columns, mean[columns], deviation[columns], POSE_OFFSETS, euclidean_distance)


def sounds(database: Database) -> Stream:
    """13 MFCC and the log mean energy: 14 numbers a frame, 112 a feature, compared by cosine distance."""
    columns = np.arange(STATIC)
    mean, deviation = database.feature_mean[columns], database.feature_deviation[columns]
    return Stream(database.features, columns, mean, deviation, AUDIO_OFFSETS, cosine_distance)


def euclidean_distance(features: np.ndarray, query: np.ndarray) -> np.ndarray:
    """(r,) distance of each row of features (r, d) from a query (d,)."""
    return _length(features - query)


def cosine_distance(features: np.ndarray, query: np.ndarray) -> np.ndarray:
    """(r,) cosine distance of each row of features (r, d) from a query (d,).

    It is half the squared distance of the unit vectors, and so exactly 0 between equal vectors.
    """
    return _length(unit_rows(features) - unit_rows(query[None])) ** 2 / 2


def unit_rows(vectors: np.ndarray) -> np.ndarray:
    """Rows (r, d) at length 1; a row of zeros stays."""
    return vectors / np.maximum(_length(vectors), 1e-12)[:, None]


def _length(vectors: np.ndarray) -> np.ndarray:
    """Length of each row. Equal rows give equal lengths to the last bit, which a matrix product would not."""
    return np.sqrt(np.einsum("ij,ij->i", vectors, vectors))
