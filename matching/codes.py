"""Features in a byte or two a number, with bounds of what that loses.

Whole numbers are small and quickly added up, and still no distance is ever taken for smaller or larger than
it can be: the length of what a code loses is known, and bounds the error of every distance (triangle
inequality).
"""

from collections.abc import Iterator

import numpy as np
from tqdm import tqdm

from gesture_bot.corpus.database import SEQUENCE
from gesture_bot.matching.features import Stream, cosine_distance
from gesture_bot.matching.kernels import table

AXES, FINER = 16, 4
"""Principal axes on which poses are coded; beyond them lie 0.1% of the variance of the demo corpus. Of the
first ones, which would lose most, what the code loses is coded, too."""

BYTE, SHORT = 127, 4095
"""Largest codes; with SHORT, 112 products of a code and a number of the query add up in 32 bits."""

SAMPLE = 100_000
"""Frames from which axes and steps are taken."""

TOGETHER = 512
"""Sequences that are coded at once."""

_UP = 1.00001
"""Factor on a bound, so that it stays one when it is rounded itself."""


class PoseCodes:
    """The poses of all sequences in bytes, on their principal axes; features are stacked when they are read.

    What the other axes hold is at a right angle to these, so that its length bounds what it adds. The codes
    lie in the order in which the search reads them; see codes.hpp.

    Args:
        stream: Poses.
        starts: (S,) rows at which the sequences begin.
    """

    def __init__(self, stream: Stream, starts: np.ndarray) -> None:
        sample = stream.z_scored(stream.frames[:: -(-len(stream.frames) // SAMPLE)])
        self._axes = np.linalg.eigh(sample.T @ sample)[1][:, : -AXES - 1 : -1]
        # Nearly all numbers keep within this; the few others are clipped.
        largest = np.maximum(np.quantile(np.abs(sample @ self._axes), 0.9999, axis=0), 1e-3)
        self._steps = np.append(largest / BYTE, largest[:FINER] / BYTE / (2 * BYTE))
        count, greatest, longest = len(starts), 0.0, 0.0
        self.codes = np.empty((count, 2, (AXES + FINER) // 2, 4, 8, 2), np.int8)
        self.squares = np.empty((count, 2, 4, 8), np.float32)
        self.errors, self.rests = np.empty((2, count), np.float32)
        for part, frames in _parts(stream, starts):
            on_axes = frames @ self._axes
            codes = _rounded(on_axes, self._steps[:AXES], BYTE)
            lost = on_axes[..., :FINER] - codes[..., :FINER] * self._steps[:FINER]
            codes = np.concatenate([codes, _rounded(lost, self._steps[AXES:], BYTE)], axis=-1)
            kept = codes * self._steps
            kept[..., :FINER] += kept[..., AXES:]
            kept = kept[..., :AXES]
            rests = _stacked(frames**2, stream.offsets) - _stacked(on_axes**2, stream.offsets)
            squares = _stacked(kept**2, stream.offsets) + rests
            in_lanes = codes[:, :SEQUENCE].reshape(-1, 8, 4, 2, (AXES + FINER) // 2, 2)
            self.codes[part] = in_lanes.transpose(0, 3, 4, 2, 1, 5)
            self.squares[part] = squares.reshape(-1, 8, 4, 2).transpose(0, 3, 2, 1)
            self.errors[part] = _UP * np.sqrt(_stacked((on_axes - kept) ** 2, stream.offsets).max(axis=1))
            self.rests[part] = _UP * np.sqrt(np.maximum(rests.max(axis=1), 0))
            lengths = np.sqrt(_stacked(codes.astype(np.float64) ** 2, stream.offsets))
            longest = max(longest, float(lengths.max()))
            greatest = max(greatest, float(squares.max()))
        self._axes = np.ascontiguousarray(self._axes)
        arrays = self.codes, self.squares, self.errors, self.rests, self._axes, self._steps
        self.table = table(arrays, greatest, longest)


class FrameCodes:
    """The frames of all sequences in whole numbers; features are stacked when they are read.

    Args:
        stream: Poses or sounds.
        starts: (S,) rows at which the sequences begin.
        largest: BYTE or SHORT, the largest code.
    """

    def __init__(self, stream: Stream, starts: np.ndarray, largest: int) -> None:
        cosine = stream.distance is cosine_distance
        step = max(1e-9, *(float(np.abs(frames).max()) for _, frames in _parts(stream, starts))) / largest
        count, greatest = len(starts), 0.0
        reach, numbers = int(stream.offsets[-1]), len(stream.columns)
        code = np.int8 if largest == BYTE else np.int16
        self.codes = np.empty((count, SEQUENCE + reach, numbers), code)
        self.lengths = np.empty((count, SEQUENCE), np.float32)
        self.errors = np.empty(count, np.float32)
        for part, frames in _parts(stream, starts):
            rounded = _rounded(frames, step, largest)
            self.codes[part] = rounded
            lengths = np.sqrt(_stacked((rounded * step) ** 2, stream.offsets))
            losses = np.sqrt(_stacked((frames - rounded * step) ** 2, stream.offsets))
            greatest = max(greatest, float(lengths.max()))
            if cosine:
                # Of unit vectors, the loss is at most 2 * loss / (both lengths), which are 2 * length - loss
                # at least; and it is never more than 2.
                losses = np.minimum(losses / np.maximum(lengths - losses / 2, 1e-9), 2)
                losses[lengths < 1e-6] = 2
                lengths = 1 / np.maximum(lengths, 1e-6)
            self.lengths[part] = lengths
            self.errors[part] = _UP * losses.max(axis=1) + 1e-7
        self.table = table((self.codes, self.lengths, self.errors), step, greatest)


def _parts(stream: Stream, starts: np.ndarray) -> Iterator[tuple[slice, np.ndarray]]:
    """Parts of the sequences, with their z-scored frames (s, 64 + reach of a feature, d)."""
    frames = np.arange(SEQUENCE + stream.offsets[-1])
    for begin in tqdm(
        range(0, len(starts), TOGETHER), "indexing the database", leave=False, delay=3, disable=None
    ):
        part = slice(begin, begin + TOGETHER)
        yield part, stream.z_scored(stream.frames[starts[part, None] + frames])
        stream.release()


def _rounded(numbers: np.ndarray, steps: np.ndarray | float, levels: int) -> np.ndarray:
    return np.clip(np.rint(numbers / steps), -levels, levels).astype(np.int16)


def _stacked(numbers: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """(s, 64) sums over the frames of each feature, of numbers (s, frames, d)."""
    sums = numbers.sum(axis=-1)
    return sum(sums[:, offset : offset + SEQUENCE] for offset in offsets)
