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
from gesture_bot.matching.kernels import AXES, FINE_AXES, FINE_CODE, FRAME_QUERY, POSE_QUERY

LEVELS = 4095
"""Largest code of a number of a frame or of a query: 112 products of two add up in 32 bits."""

SAMPLE = 1000
"""Sequences from which axes and steps are taken."""

TOGETHER = 512
"""Sequences that are coded at once."""

ROUNDING = 1e-5
"""Bound of the rounding error of a sum in single precision, as a share of the squares that go into it."""

_UP = 1.00001
"""Factor on a bound, so that it stays one when it is rounded itself."""


class PoseCodes:
    """The pose features of all windows, turned to their principal axes, which keeps Euclidean distances.

    The coarse code rounds the first AXES numbers to bytes. The fine code does so with the first FINE_AXES; of
    those that the coarse code holds, it rounds what that lost. What lies on the other axes is the tail: of it
    only the length is kept, which bounds its product with another tail (Cauchy and Schwarz).

    Args:
        stream: Poses.
        starts: (S,) rows at which the sequences begin.
    """

    def __init__(self, stream: Stream, starts: np.ndarray) -> None:
        windows = np.arange(SEQUENCE)
        features = stream.at((starts[:: -(-len(starts) // SAMPLE), None] + windows).ravel())
        self._axes = np.linalg.eigh(features.T @ features)[1][:, : -FINE_AXES - 1 : -1].copy()
        turned, squares = features @ self._axes, (features**2).sum(axis=1)
        self._fine_steps = np.maximum(np.abs(turned).max(axis=0), 1e-9) / 127
        self._steps = self._fine_steps[:AXES].copy()
        self._fine_steps[:AXES] /= 254
        self._tail_step = _tail(squares, turned[:, :AXES]).max() / 250 + 1e-9

        count, self._largest = len(starts), 0.0
        self.coarse = np.empty((count, AXES // 2, SEQUENCE, 2), np.int8)
        self.squares = np.empty((count, SEQUENCE), np.float32)
        self.tails = np.empty((count, SEQUENCE), np.uint8)
        self.errors = np.empty(count, np.float32)
        self.fine = np.empty((count, SEQUENCE), FINE_CODE)
        self.fine_errors = np.empty(count, np.float32)
        for part in _parts(count, stream, "poses"):
            features = stream.at((starts[part, None] + windows).ravel())
            self._code(part, features.reshape(-1, SEQUENCE, features.shape[1]))
        self._codes = kernels.addresses(
            self.coarse, self.squares, self.tails, self.errors, self.fine, self.fine_errors
        )

    def _code(self, part: slice, features: np.ndarray) -> None:
        turned, squares = features @ self._axes, (features**2).sum(axis=-1)
        self._largest = max(self._largest, float(squares.max()))

        head = turned[..., :AXES]
        coarse = _rounded(head, self._steps)
        kept = coarse * self._steps
        tail = _tail(squares, head)
        tails = np.minimum(np.ceil(tail / self._tail_step), 255)
        short = np.minimum(tail, 255 * self._tail_step)  # what is left of a tail too long for a byte is lost
        self.coarse[part] = coarse.reshape(-1, SEQUENCE, AXES // 2, 2).transpose(0, 2, 1, 3)
        self.squares[part] = (kept**2).sum(axis=-1) + short**2
        self.tails[part] = tails
        self.errors[part] = _largest_length(((head - kept) ** 2).sum(axis=-1) + (tail - short) ** 2)

        rest = turned.copy()
        rest[..., :AXES] -= kept
        fine = _rounded(rest, self._fine_steps)
        lost = rest - fine * self._fine_steps
        tail = _tail(squares, turned)
        self.fine["numbers"][part] = fine
        self.fine["square"][part] = ((turned - lost) ** 2).sum(axis=-1) + tail**2
        self.fine["tail"][part] = _UP * tail
        self.fine_errors[part] = _largest_length((lost**2).sum(axis=-1))

    def nearest(self, query: np.ndarray, words: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Bounds of the smallest distance from a query (96,) in each sequence, and where it may be.

        Args:
            query: Pose feature.
            words: (S,) uint64 bits of the frames that are looked at.

        Returns:
            (S,) float64 bounds from below and above; and (S,) uint64 bits of the frames that may have it.
            Where the distance may be 0, the bound from below is 0, and that from above leaves this distance
            out. Where no frame is looked at, the bounds mean nothing.
        """
        turned, square = query @ self._axes, query @ query
        tail, fine_tail = (2 * _UP * (_tail(square, turned[:axes]) + 1e-6) for axes in (AXES, FINE_AXES))
        # Where the weights of the coarse code are rounded, the query is another one, and not far.
        weights, step = _whole(2 * self._steps * turned[:AXES], 32767)
        head = weights * step / (2 * self._steps)
        square += head @ head - turned[:AXES] @ turned[:AXES]
        error = _UP * np.sqrt(((head - turned[:AXES]) ** 2).sum())
        fine_weights, fine_step = _whole(2 * self._fine_steps * np.append(head, turned[AXES:]), 32767)
        rounding = ROUNDING * (self._largest + square) + 127 / 2 * FINE_AXES * fine_step
        tails = tail * self._tail_step, fine_tail
        numbers = weights, fine_weights, step, fine_step, *tails, square, error, rounding
        return kernels.nearest("poses", self._codes, np.array(numbers, POSE_QUERY), words)


class FrameCodes:
    """The frames of all sequences in 16-bit numbers; features are stacked when they are read.

    Even and odd frames lie apart, so that those of a feature lie side by side.

    Args:
        stream: Poses or sounds.
        starts: (S,) rows at which the sequences begin.
    """

    def __init__(self, stream: Stream, starts: np.ndarray) -> None:
        self._cosine = stream.distance is cosine_distance
        sample = stream.z_scored(stream.frames[:: -(-len(stream.frames) // (SAMPLE * SEQUENCE))])
        self._step = float(np.abs(sample).max()) / LEVELS
        count, self._largest = len(starts), 0.0
        frames = SEQUENCE + int(stream.offsets[-1])
        self.codes = np.empty((count, 2, frames // 2, sample.shape[1]), np.int16)
        self.lengths = np.empty((count, SEQUENCE), np.float32)
        self.errors = np.empty(count, np.float32)
        for part in _parts(count, stream, "frames"):
            numbers = stream.z_scored(stream.frames[starts[part, None] + np.arange(frames)])
            rounded = _rounded(numbers, self._step, LEVELS)
            self.codes[part] = rounded.reshape(len(rounded), -1, 2, sample.shape[1]).transpose(0, 2, 1, 3)
            lengths = np.sqrt(_stacked((rounded * self._step) ** 2, stream.offsets))
            losses = np.sqrt(_stacked((numbers - rounded * self._step) ** 2, stream.offsets))
            self._largest = max(self._largest, float(lengths.max()))
            if self._cosine:
                # Of unit vectors, the loss is at most 2 * loss / (both lengths), and never more than 2.
                losses = np.minimum(losses / np.maximum(lengths - losses / 2, 1e-9), 2)
                losses[lengths < 1e-6] = 2
                lengths = 1 / np.maximum(lengths, 1e-6)
            self.lengths[part] = lengths
            self.errors[part] = _UP * losses.max(axis=1) + 1e-7
        self._codes = kernels.addresses(self.codes, self.lengths, self.errors)
        self._what = "sounds" if self._cosine else "poses"

    def nearest(self, query: np.ndarray, words: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """See PoseCodes.nearest."""
        return kernels.nearest(self._what, self._codes, self._rounded(query), words)

    def compare(self, query: np.ndarray, frames: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(S,) bounds of the distances that hold whichever of its frames (S,) a sequence shows."""
        return kernels.compare(self._what, self._codes, self._rounded(query), frames)

    def _rounded(self, query: np.ndarray) -> np.ndarray:
        if self._cosine:
            query = unit_rows(query[None])[0]
        whole, step = _whole(query, LEVELS)
        rounded = whole * step
        error = _UP * np.sqrt(((query - rounded) ** 2).sum())
        square = query @ query if self._cosine else rounded @ rounded
        rounding = ROUNDING * (1.0 if self._cosine else self._largest**2 + square)
        weights = np.zeros(112, np.int16)
        weights[: len(whole)] = whole
        return np.array((weights, step * self._step, square, error, rounding), FRAME_QUERY)


def _parts(count: int, stream: Stream, what: str) -> Iterator[slice]:
    """Parts of so many sequences; what was read for one is released before the next."""
    for begin in tqdm(range(0, count, TOGETHER), f"indexing {what}", leave=False, delay=3):
        yield slice(begin, begin + TOGETHER)
        stream.release()


def _rounded(numbers: np.ndarray, steps: np.ndarray | float, levels: int = 127) -> np.ndarray:
    return np.clip(np.rint(numbers / steps), -levels, levels).astype(np.int8 if levels < 128 else np.int16)


def _whole(numbers: np.ndarray, levels: int) -> tuple[np.ndarray, float]:
    """Whole numbers from -levels to levels, and their step."""
    step = max(float(np.abs(numbers).max()), 1e-9) / levels
    return np.rint(numbers / step).astype(np.int16), step


def _tail(squares: np.ndarray, kept: np.ndarray) -> np.ndarray:
    """Length of what is left of vectors of some squared length beyond the numbers (..., a) that are kept."""
    return np.sqrt(np.maximum(squares - (kept**2).sum(axis=-1), 0))


def _largest_length(squares: np.ndarray) -> np.ndarray:
    return _UP * np.sqrt(squares.max(axis=-1))


def _stacked(numbers: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """(s, 64) sums over the frames of each feature, of numbers (s, frames, d)."""
    sums = numbers.sum(axis=-1)
    return sum(sums[:, offset : offset + SEQUENCE] for offset in offsets)
