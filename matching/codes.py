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

SAMPLE = 100_000
"""Frames from which steps are taken."""

TOGETHER = 512
"""Sequences that are coded at once."""

ROUNDING = 1e-5
"""Bound of the rounding error of a sum in single precision, as a share of the squares that go into it."""

_UP = 1.00001
"""Factor on a bound, so that it stays one when it is rounded itself."""


class PoseCodes:
    """The poses of all sequences in bytes; features are stacked when they are read.

    The numbers of a pose lie in pairs, those of all 64 frames together: this is the order in which one
    instruction multiplies and adds sixteen of them.

    Args:
        stream: Poses.
        starts: (S,) rows at which the sequences begin.
    """

    def __init__(self, stream: Stream, starts: np.ndarray) -> None:
        self._steps = _largest(stream) / 127
        count, self._greatest = len(starts), 0.0
        # The last shifted read ends a little after the last sequence.
        numbers = len(stream.columns)
        self.codes = np.zeros((count + 1, numbers // 2, SEQUENCE, 2), np.int8)
        self.squares = np.empty((count, SEQUENCE), np.float32)
        self.errors = np.empty(count, np.float32)
        for part, frames in _parts(stream, starts):
            rounded = _rounded(frames, self._steps, 127)
            codes = rounded[:, :SEQUENCE].reshape(-1, SEQUENCE, numbers // 2, 2)
            self.codes[part.start : part.start + len(codes)] = codes.transpose(0, 2, 1, 3)
            squares = _stacked((rounded * self._steps) ** 2, stream.offsets)
            losses = _stacked((frames - rounded * self._steps) ** 2, stream.offsets)
            self.squares[part] = squares
            self.errors[part] = _UP * np.sqrt(losses.max(axis=1))
            self._greatest = max(self._greatest, float(squares.max()))
        self.addresses = kernels.addresses(self.codes, self.squares, self.errors)

    def rounded(self, query: np.ndarray) -> np.ndarray:
        """A POSE_QUERY of a pose feature (96,)."""
        weights = query.reshape(-1, len(self._steps)) * self._steps
        whole, step = _whole(weights, 32767)
        rounded = whole * step / self._steps
        square, error = (rounded**2).sum(), _UP * np.linalg.norm(rounded.ravel() - query)
        rounding = ROUNDING * (self._greatest + square)
        return np.array((whole, 2 * step, square, error, rounding), POSE_QUERY)


class FrameCodes:
    """The frames of all sequences in 16-bit numbers; features are stacked when they are read.

    Even and odd frames lie apart, so that those of a feature lie side by side.

    Args:
        stream: Poses or sounds.
        starts: (S,) rows at which the sequences begin.
    """

    def __init__(self, stream: Stream, starts: np.ndarray) -> None:
        self._cosine = stream.distance is cosine_distance
        self._step = float(_largest(stream).max()) / LEVELS
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
        self.addresses = kernels.addresses(self.codes, self.lengths, self.errors)

    def rounded(self, query: np.ndarray) -> np.ndarray:
        """A FRAME_QUERY of a feature, (96,) of poses or (112,) of sounds."""
        if self._cosine:
            query = unit_rows(query[None])[0]
        whole, step = _whole(query, LEVELS)
        rounded = whole * step
        error = _UP * np.sqrt(((query - rounded) ** 2).sum())
        square = query @ query if self._cosine else rounded @ rounded
        rounding = ROUNDING * (1.0 if self._cosine else self._greatest**2 + square)
        weights = np.zeros(112, np.int16)
        weights[: len(whole)] = whole
        return np.array((weights, step * self._step, square, error, rounding), FRAME_QUERY)


def bounds(
    codes: PoseCodes | FrameCodes,
    query: np.ndarray,
    words: np.ndarray,
    other: FrameCodes | None,
    other_query: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Bounds of the smallest distance from a query in each sequence, and of the other one where that is.

    Args:
        codes: What the first distance compares.
        query: (96,) or (112,) its query.
        words: (S,) uint64 bits of the frames that are looked at.
        other: What the second distance compares; None: there is none.
        other_query: (112,) or (96,) its query.

    Returns:
        (S,) float64 bounds from below and above, and (S,) uint64 bits of the frames that may have the
        smallest distance. Where that may be 0, the bound from below is 0, and that from above leaves this
        distance out. Then (S,) bounds from below and above of the second distance, whichever of these frames
        is shown. Where no frame is looked at, bounds mean nothing.
    """
    compared = [codes.addresses, codes.rounded(query), None, None]
    if other:
        compared[2:] = other.addresses, other.rounded(other_query)
    near, far, other_near, other_far = np.empty((4, len(words)))
    frames = np.empty_like(words)
    search = "search_poses" if isinstance(codes, PoseCodes) else "search_sounds"
    kernels.call(search, *compared, len(words), words, near, far, frames, other_near, other_far)
    return near, far, frames, other_near, other_far


def _largest(stream: Stream) -> np.ndarray:
    """(d,) what nearly all z-scored numbers of a stream keep within; the few others are clipped."""
    frames = stream.frames[:: -(-len(stream.frames) // SAMPLE)]
    return np.maximum(np.quantile(np.abs(stream.z_scored(frames)), 0.9999, axis=0), 1e-3)


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
