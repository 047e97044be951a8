"""Features in a byte or two a number, with bounds of what that loses.

Whole numbers are small and quickly added up, and still no distance is ever taken for smaller or larger than
it can be: the length of what a code loses is known, and bounds the error of every distance (triangle
inequality).
"""

from collections.abc import Iterator

import numpy as np
from tqdm import tqdm

from gesture_bot.corpus.database import SEQUENCE
from gesture_bot.matching.features import Stream, cosine_distance, unit_rows
from gesture_bot.matching.kernels import FRAME_CODES, FRAME_QUERY, PAIRS, POSE_CODES, POSE_QUERY

AXES = 16
"""Principal axes on which poses are coded; beyond them lie 0.1% of the variance of the demo corpus."""

FINER = 2 * PAIRS - AXES
"""First axes of which what the code loses is coded, too: they would lose most."""

BYTE, SHORT = 127, 4095
"""Largest codes; with SHORT, 112 products of a code and a number of the query add up in 32 bits."""

SAMPLE = 100_000
"""Frames from which axes and steps are taken."""

TOGETHER = 512
"""Sequences that are coded at once."""

ROUNDING = 1e-5
"""Bound of the rounding error of a sum in single precision, as a share of the squares that go into it."""

_UP = 1.00001
"""Factor on a bound, so that it stays one when it is rounded itself."""


class PoseCodes:
    """The poses of all sequences in bytes, on their principal axes; features are stacked when they are read.

    What the other axes hold is at a right angle to these, so that its length bounds what it adds. The codes
    lie in the order in which the search reads them; see kernels.cpp.

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
        count, self._greatest, self._longest = len(starts), 0.0, 0.0
        self.codes = np.empty((count, 2, PAIRS, 4, 8, 2), np.int8)
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
            in_lanes = codes[:, :SEQUENCE].reshape(-1, 8, 4, 2, PAIRS, 2)
            self.codes[part] = in_lanes.transpose(0, 3, 4, 2, 1, 5)
            self.squares[part] = squares.reshape(-1, 8, 4, 2).transpose(0, 3, 2, 1)
            self.errors[part] = _UP * np.sqrt(_stacked((on_axes - kept) ** 2, stream.offsets).max(axis=1))
            self.rests[part] = _UP * np.sqrt(np.maximum(rests.max(axis=1), 0))
            lengths = np.sqrt(_stacked(codes.astype(np.float64) ** 2, stream.offsets))
            self._longest = max(self._longest, float(lengths.max()))
            self._greatest = max(self._greatest, float(squares.max()))
        arrays = self.codes, self.squares, self.errors, self.rests
        self.table = np.array(tuple(array.ctypes.data for array in arrays), POSE_CODES)

    def query(self, feature: np.ndarray) -> np.ndarray:
        """A POSE_QUERY of a pose feature (96,)."""
        poses = feature.reshape(-1, len(self._axes))
        on_axes = poses @ self._axes
        wanted = np.concatenate([on_axes, on_axes[:, :FINER]], axis=1) * self._steps
        weights, step = _whole(wanted, 32767)
        square = float(feature @ feature)
        rest = max(square - float((on_axes**2).sum()), 0.0)
        rounding = ROUNDING * (self._greatest + square)
        rounding += 2 * self._longest * float(np.linalg.norm(weights * step - wanted))
        in_pairs = weights.reshape(-1, PAIRS, 2).transpose(1, 0, 2)
        return np.array((in_pairs, 2 * step, square, 2 * _UP * np.sqrt(rest), rounding), POSE_QUERY)


class FrameCodes:
    """The frames of all sequences in whole numbers; features are stacked when they are read.

    Even and odd frames lie apart, so that those of a feature lie side by side.

    Args:
        stream: Poses or sounds.
        starts: (S,) rows at which the sequences begin.
        largest: BYTE or SHORT, the largest code.
    """

    def __init__(self, stream: Stream, starts: np.ndarray, largest: int) -> None:
        cosine = stream.distance is cosine_distance
        step = max(float(np.abs(frames).max()) for _, frames in _parts(stream, starts)) / largest
        count, greatest = len(starts), 0.0
        reach, numbers = int(stream.offsets[-1]), len(stream.columns)
        code = np.int8 if largest == BYTE else np.int16
        self.codes = np.empty((count, 2, (SEQUENCE + reach) // 2, numbers), code)
        self.lengths = np.empty((count, SEQUENCE), np.float32)
        self.errors = np.empty(count, np.float32)
        for part, frames in _parts(stream, starts):
            rounded = _rounded(frames, step, largest)
            self.codes[part] = rounded.reshape(len(rounded), -1, 2, numbers).transpose(0, 2, 1, 3)
            lengths = np.sqrt(_stacked((rounded * step) ** 2, stream.offsets))
            losses = np.sqrt(_stacked((frames - rounded * step) ** 2, stream.offsets))
            greatest = max(greatest, float(lengths.max()))
            if cosine:
                # Of unit vectors, the loss is at most 2 * loss / (both lengths), and never more than 2.
                losses = np.minimum(losses / np.maximum(lengths - losses / 2, 1e-9), 2)
                losses[lengths < 1e-6] = 2
                lengths = 1 / np.maximum(lengths, 1e-6)
            self.lengths[part] = lengths
            self.errors[part] = _UP * losses.max(axis=1) + 1e-7
        addresses = (array.ctypes.data for array in (self.codes, self.lengths, self.errors))
        rounding = ROUNDING * (1.0 if cosine else greatest**2)
        self.table = np.array((*addresses, step, rounding), FRAME_CODES)


def frame_query(stream: Stream, feature: np.ndarray) -> np.ndarray:
    """A FRAME_QUERY of a feature of a stream, (96,) of poses or (112,) of sounds."""
    cosine = stream.distance is cosine_distance
    if cosine:
        feature = unit_rows(feature[None])[0]
    whole, step = _whole(feature, SHORT)
    rounded = whole * step
    lost = feature - rounded
    error = _UP * np.sqrt(lost @ lost)
    square = feature @ feature if cosine else rounded @ rounded
    rounding = 0.0 if cosine else ROUNDING * square
    weights = np.zeros(112, np.int16)
    weights[: len(whole)] = whole
    return np.array((weights, step, square, error, rounding), FRAME_QUERY)


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
