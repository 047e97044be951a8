"""Features rounded to bytes, with bounds of what that loses.

Sums of bytes are fast and small, and still no distance is ever taken for smaller or larger than it can be:
the length of what a code loses is known, and bounds the error of every distance (triangle inequality).
"""

from collections.abc import Iterator

import numpy as np
from tqdm import tqdm

from gesture_bot.corpus.database import SEQUENCE
from gesture_bot.matching import kernels
from gesture_bot.matching.features import Stream, cosine_distance, unit_rows

AXES = 24
"""Principal axes that the coarse code of a pose keeps."""

FINE_AXES = 48
"""Principal axes that its fine code keeps."""

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

    Both are tuples of bytes, (S, AXES, 64) and (S, 64, FINE_AXES); (S, 64) squared lengths with the tail;
    (S, 64) lengths of the tail in steps, rounded up; and (S,) largest length of what a sequence's codes lose.

    Args:
        stream: Poses.
        starts: (S,) rows at which the sequences begin.
    """

    def __init__(self, stream: Stream, starts: np.ndarray) -> None:
        windows = np.arange(SEQUENCE)
        sample = starts[:: -(-len(starts) // SAMPLE), None] + windows
        features = stream.at(sample.ravel())
        self._axes = np.linalg.eigh(features.T @ features)[1][:, : -FINE_AXES - 1 : -1]
        turned = features @ self._axes
        steps = np.maximum(np.abs(turned).max(axis=0), 1e-9) / 127
        self._steps, self._fine_steps = steps[:AXES], steps.copy()
        self._fine_steps[:AXES] /= 254
        squares = (features**2).sum(axis=1)
        self._tail_steps = [_tail(squares, turned[:, :axes]).max() / 250 + 1e-9 for axes in (AXES, FINE_AXES)]
        self._largest = 0.0

        count = len(starts)
        self._coarse = (np.empty((count, AXES, SEQUENCE), np.int8), *_empty_bounds(count))
        self._fine = (np.empty((count, SEQUENCE, FINE_AXES), np.int8), *_empty_bounds(count))
        for part in _parts(count, TOGETHER, "poses"):
            features = stream.at((starts[part, None] + windows).ravel())
            self._code(part, features.reshape(-1, SEQUENCE, features.shape[1]))
            stream.release()

    def _code(self, part: slice, features: np.ndarray) -> None:
        turned = features @ self._axes
        squares = (features**2).sum(axis=-1)
        self._largest = max(self._largest, float(squares.max()))
        coarse = _rounded(turned[..., :AXES], self._steps)
        rest = turned.copy()
        rest[..., :AXES] -= coarse * self._steps
        fine = _rounded(rest, self._fine_steps)
        self._coarse[0][part] = coarse.transpose(0, 2, 1)
        self._fine[0][part] = fine
        for code, axes, lost, tail_step in (
            (self._coarse, AXES, rest[..., :AXES], self._tail_steps[0]),
            (self._fine, FINE_AXES, rest - fine * self._fine_steps, self._tail_steps[1]),
        ):
            tail = _tail(squares, turned[..., :axes])
            tails = np.minimum(np.ceil(tail / tail_step), 255)
            kept = np.minimum(tail, 255 * tail_step)
            code[1][part] = ((turned[..., :axes] - lost) ** 2).sum(axis=-1) + kept**2
            code[2][part] = tails
            code[3][part] = _UP * np.sqrt(((lost**2).sum(axis=-1) + (tail - kept) ** 2).max(axis=-1))

    def nearest(self, query: np.ndarray, words: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Bounds of the smallest distance from a query (96,) in each sequence, and where it may be.

        Args:
            query: Pose feature.
            words: (S,) uint64 bits of the frames that are looked at.

        Returns:
            (S,) float64 bounds from below and above, 0 where it may be 0, and infinite where no frame is
            looked at; and (S,) uint64 bits of the frames that may have it. The bound from above leaves out
            distances that may be 0.
        """
        turned, square = query @ self._axes, query @ query
        tails = [
            2 * _UP * step * (_tail(square, turned[:axes]) + 1e-6)
            for axes, step in zip((AXES, FINE_AXES), self._tail_steps, strict=True)
        ]
        fine_weights, fine_step = _whole(2 * self._fine_steps * turned)
        rounding = ROUNDING * (self._largest + square) + 127 / 2 * FINE_AXES * fine_step
        return kernels.scan_poses(
            self._coarse,
            self._fine,
            np.float32(2 * self._steps * turned[:AXES]),
            fine_weights,
            np.float32(fine_step),
            np.float32(tails),
            np.float32(square),
            np.float32(rounding),
            words,
        )


class FrameCodes:
    """Every frame of a stream, rounded to bytes and stored once; features are stacked when they are read.

    Attributes:
        stored: Bytes (2, n, d), the even and the odd rows, so that the frames of a feature lie side by side;
            (N,) lengths of the features that begin at each row; (S,) largest length of what a sequence's
            features lose; (S,) rows at which the sequences begin.

    Args:
        stream: Poses or sounds.
        starts: (S,) rows at which the sequences begin.
    """

    def __init__(self, stream: Stream, starts: np.ndarray) -> None:
        sample = stream.z_scored(stream.frames[:: -(-len(stream.frames) // (SAMPLE * SEQUENCE))])
        self._step = float(np.quantile(np.abs(sample), 0.9999)) / 127
        self._cosine = stream.distance is cosine_distance
        count, reach = len(stream.frames), int(stream.offsets[-1])
        codes = np.zeros((2, count // 2 + reach, sample.shape[1]), np.int8)
        squares, losses = np.zeros(count + reach), np.zeros(count + reach)
        for part in _parts(count, SEQUENCE * TOGETHER, "frames"):
            frames = stream.z_scored(stream.frames[part])
            rounded = _rounded(frames, self._step)
            for parity in (0, 1):
                rows = slice(part.start // 2, part.start // 2 + len(rounded[parity::2]))
                codes[parity, rows] = rounded[parity::2]
            place = slice(part.start, part.start + len(frames))
            squares[place] = ((rounded * self._step) ** 2).sum(axis=1)
            losses[place] = ((frames - rounded * self._step) ** 2).sum(axis=1)
            stream.release()
        lengths = np.sqrt(sum(squares[offset : count + offset] for offset in stream.offsets))
        losses = sum(losses[offset : count + offset] for offset in stream.offsets)
        lost = np.sqrt(losses[starts[:, None] + np.arange(SEQUENCE)].max(axis=1))
        numbers = sample.shape[1]
        self._stored = codes.reshape(2, -1), numbers, lengths.astype(np.float32), np.float32(_UP * lost + 1e-6), starts
        self._largest = float(lengths.max())

    def nearest(self, query: np.ndarray, words: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """See PoseCodes.nearest."""
        return kernels.scan_frames(self._stored, self._rounded_query(query), words)

    def compare(self, query: np.ndarray, frames: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(S,) bounds of the distances that hold whichever of its frames (S,) a sequence shows."""
        return kernels.compare_frames(self._stored, self._rounded_query(query), frames)

    def _rounded_query(self, query: np.ndarray) -> tuple:
        """Whole numbers, their step, squared length, what they lose, rounding error, and which distance."""
        if self._cosine:
            query = unit_rows(query[None])[0]
        whole, step = _whole(query)
        rounded = whole * step
        square = query @ query if self._cosine else rounded @ rounded
        lost = _UP * np.sqrt(((query - rounded) ** 2).sum())
        rounding = ROUNDING * (1.0 if self._cosine else self._largest**2 + square)
        numbers = np.float32([step * self._step, square, lost, rounding])
        return whole, *numbers, self._cosine


def _parts(count: int, together: int, what: str) -> Iterator[slice]:
    for begin in tqdm(range(0, count, together), f"indexing {what}", leave=False, delay=3):
        yield slice(begin, begin + together)


def _rounded(numbers: np.ndarray, steps: np.ndarray | float) -> np.ndarray:
    return np.clip(np.rint(numbers / steps), -127, 127).astype(np.int8)


def _whole(numbers: np.ndarray) -> tuple[np.ndarray, float]:
    """Numbers as 16-bit ones, and the step between these."""
    step = max(float(np.abs(numbers).max()), 1e-9) / 32767
    return np.rint(numbers / step).astype(np.int16), step


def _tail(squares: np.ndarray, kept: np.ndarray) -> np.ndarray:
    """Length of what is left of vectors of some squared length beyond the numbers (..., a) that are kept."""
    return np.sqrt(np.maximum(squares - (kept**2).sum(axis=-1), 0))


def _empty_bounds(count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Squared lengths, tails and errors of a code."""
    windows = count, SEQUENCE
    return np.empty(windows, np.float32), np.empty(windows, np.uint8), np.empty(count, np.float32)
