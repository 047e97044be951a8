"""Features in a byte or two a number, with bounds of what that loses.

Whole numbers are small and quickly added up, and still no distance is ever taken for smaller or larger than
it can be: the length of what a code loses is known, and bounds the error of every distance (triangle
inequality).
"""

from collections.abc import Iterator

import numpy as np
from tqdm import tqdm

from gesture_bot.corpus.database import SEQUENCE
from gesture_bot.matching import kernels
from gesture_bot.matching.features import Stream, cosine_distance, unit_rows
from gesture_bot.matching.kernels import FRAME_QUERY, POSE_QUERY

LEVELS = 4095
"""Largest code of a number of a frame or of a query: 112 products of two add up in 32 bits."""

AXES = 16
"""Principal axes on which poses are coded; beyond them lie 0.1% of the variance of the demo corpus."""

SAMPLE = 100_000
"""Frames from which steps and axes are taken."""

TOGETHER = 512
"""Sequences that are coded at once."""

ROUNDING = 1e-5
"""Bound of the rounding error of a sum in single precision, as a share of the squares that go into it."""

_UP = 1.00001
"""Factor on a bound, so that it stays one when it is rounded itself."""


class PoseCodes:
    """The poses of all sequences in bytes, on their principal axes; features are stacked when they are read.

    What the other axes hold is at a right angle to these, so that its length bounds what it adds. The numbers
    of a pose lie in pairs, those of all 64 frames together: this is the order in which one instruction
    multiplies and adds sixteen of them.

    Args:
        stream: Poses.
        starts: (S,) rows at which the sequences begin.
    """

    def __init__(self, stream: Stream, starts: np.ndarray) -> None:
        sample = stream.z_scored(_sample(stream))
        self._axes = np.linalg.eigh(sample.T @ sample)[1][:, : -AXES - 1 : -1]
        self._steps = _largest(sample @ self._axes) / 127
        count, self._greatest = len(starts), 0.0
        # The last shifted read ends a little after the last sequence.
        self.codes = np.zeros((count + 1, AXES // 2, SEQUENCE, 2), np.int8)
        self.squares = np.empty((count, SEQUENCE), np.float32)
        self.errors, self.rests = np.empty((2, count), np.float32)
        for part, frames in _parts(stream, starts):
            on_axes = frames @ self._axes
            rounded = _rounded(on_axes, self._steps, 127)
            codes = rounded[:, :SEQUENCE].reshape(-1, SEQUENCE, AXES // 2, 2)
            self.codes[part.start : part.start + len(codes)] = codes.transpose(0, 2, 1, 3)
            rests = _stacked(frames**2, stream.offsets) - _stacked(on_axes**2, stream.offsets)
            squares = _stacked((rounded * self._steps) ** 2, stream.offsets) + rests
            losses = _stacked((on_axes - rounded * self._steps) ** 2, stream.offsets)
            self.squares[part] = squares
            self.errors[part] = _UP * np.sqrt(losses.max(axis=1))
            self.rests[part] = _UP * np.sqrt(np.maximum(rests.max(axis=1), 0))
            self._greatest = max(self._greatest, float(squares.max()))
        self._addresses = kernels.addresses(self.codes, self.squares, self.errors, self.rests)

    def coded(self, query: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The codes, and a POSE_QUERY of a pose feature (96,), for kernels.cpp."""
        poses = query.reshape(-1, len(self._axes))
        on_axes = poses @ self._axes
        weights, step = _whole(on_axes * self._steps, 32767)
        rounded = weights * step / self._steps
        rest = max(float((poses**2).sum() - (on_axes**2).sum()), 0.0)
        square, error = (rounded**2).sum() + rest, _UP * np.linalg.norm(rounded - on_axes)
        rounding = ROUNDING * (self._greatest + square)
        pairs = weights.reshape(-1, AXES // 2, 2).transpose(1, 0, 2)
        numbers = pairs, 2 * step, square, error, 2 * _UP * np.sqrt(rest), rounding
        return self._addresses, np.array(numbers, POSE_QUERY)


class FrameCodes:
    """The frames of all sequences in 16-bit numbers; features are stacked when they are read.

    Even and odd frames lie apart, so that those of a feature lie side by side.

    Args:
        stream: Poses or sounds.
        starts: (S,) rows at which the sequences begin.
    """

    def __init__(self, stream: Stream, starts: np.ndarray) -> None:
        self._cosine = stream.distance is cosine_distance
        self._step = max(float(np.abs(frames).max()) for _, frames in _parts(stream, starts)) / LEVELS
        count, self._greatest = len(starts), 0.0
        reach, numbers = int(stream.offsets[-1]), len(stream.columns)
        self.codes = np.empty((count, 2, (SEQUENCE + reach) // 2, numbers), np.int16)
        self.lengths = np.empty((count, SEQUENCE), np.float32)
        self.errors = np.empty(count, np.float32)
        for part, frames in _parts(stream, starts):
            rounded = _rounded(frames, self._step, LEVELS)
            self.codes[part] = rounded.reshape(len(rounded), -1, 2, numbers).transpose(0, 2, 1, 3)
            lengths = np.sqrt(_stacked((rounded * self._step) ** 2, stream.offsets))
            losses = np.sqrt(_stacked((frames - rounded * self._step) ** 2, stream.offsets))
            self._greatest = max(self._greatest, float(lengths.max()))
            if self._cosine:
                # Of unit vectors, the loss is at most 2 * loss / (both lengths), and never more than 2.
                losses = np.minimum(losses / np.maximum(lengths - losses / 2, 1e-9), 2)
                losses[lengths < 1e-6] = 2
                lengths = 1 / np.maximum(lengths, 1e-6)
            self.lengths[part] = lengths
            self.errors[part] = _UP * losses.max(axis=1) + 1e-7
        self._addresses = kernels.addresses(self.codes, self.lengths, self.errors)

    def coded(self, query: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The codes, and a FRAME_QUERY of a feature, (96,) of poses or (112,) of sounds, for kernels.cpp."""
        if self._cosine:
            query = unit_rows(query[None])[0]
        whole, step = _whole(query, LEVELS)
        rounded = whole * step
        error = _UP * np.sqrt(((query - rounded) ** 2).sum())
        square = query @ query if self._cosine else rounded @ rounded
        rounding = ROUNDING * (1.0 if self._cosine else self._greatest**2 + square)
        weights = np.zeros(112, np.int16)
        weights[: len(whole)] = whole
        numbers = weights, step * self._step, square, error, rounding
        return self._addresses, np.array(numbers, FRAME_QUERY)


def _sample(stream: Stream) -> np.ndarray:
    return stream.frames[:: -(-len(stream.frames) // SAMPLE)]


def _largest(numbers: np.ndarray) -> np.ndarray:
    """(d,) what nearly all numbers (n, d) keep within; the few others are clipped."""
    return np.maximum(np.quantile(np.abs(numbers), 0.9999, axis=0), 1e-3)


def _parts(stream: Stream, starts: np.ndarray) -> Iterator[tuple[slice, np.ndarray]]:
    """Parts of the sequences, with their z-scored frames (s, 64 + reach of a feature, d)."""
    frames = np.arange(SEQUENCE + stream.offsets[-1])
    for begin in tqdm(range(0, len(starts), TOGETHER), "indexing the database", leave=False, delay=3):
        part = slice(begin, begin + TOGETHER)
        yield part, stream.z_scored(stream.frames[starts[part, None] + frames])
        stream.release()


def _rounded(numbers: np.ndarray, steps: np.ndarray | float, levels: int) -> np.ndarray:
    return np.clip(np.rint(numbers / steps), -levels, levels).astype(np.int16)


def _whole(numbers: np.ndarray, levels: int) -> tuple[np.ndarray, float]:
    """Whole numbers from -levels to levels, and their step."""
    step = max(float(np.abs(numbers).max()), 1e-9) / levels
    return np.rint(numbers / step).astype(np.int16), step


def _stacked(numbers: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """(s, 64) sums over the frames of each feature, of numbers (s, frames, d)."""
    sums = numbers.sum(axis=-1)
    return sum(sums[:, offset : offset + SEQUENCE] for offset in offsets)
