"""Who wins a search: bounds of distances bound ranks, and what they leave open is looked up."""

from collections.abc import Sequence

import numpy as np

from gesture_bot.corpus.database import SEQUENCE
from gesture_bot.matching.features import Stream
from gesture_bot.matching.kernels import call


class Distances:
    """The distances of all sequences from a query, by one stream; a known one is its own bound.

    Attributes:
        query: (d,) float64.
        near: (S,) float64 bound from below.
        far: (S,) float64 bound from above.

    Args:
        stream: Poses or sounds.
        query: (d,) feature searched for.
        sequences: S.
    """

    def __init__(self, stream: Stream, query: np.ndarray, sequences: int) -> None:
        self._stream, self.query = stream, query
        self.near, self.far = np.empty((2, sequences))

    def exact(self, rows: np.ndarray) -> np.ndarray:
        """Distances of the features that begin at some rows."""
        return self._stream.distance(self._stream.at(rows), self.query)

    def know(self, sequences: np.ndarray, distances: np.ndarray) -> None:
        """Take in the distances of some sequences."""
        self.near[sequences] = self.far[sequences] = distances


class Contest:
    """The sequences that may have one of the k smallest sums of ranks, and what their ranks depend on.

    Args:
        starts: (S,) rows at which the sequences begin.
        mask: (S, 64) bool control mask.
        k: How many places matter.
        tables: Codes of poses in bytes, of poses, of sounds in bytes, and of sounds.
        ranked: One or two of `pose` and `sound`, by the first of which the frame within a sequence is chosen.
        pose, sound: Distances.
    """

    def __init__(
        self,
        starts: np.ndarray,
        mask: np.ndarray,
        k: int,
        tables: Sequence[np.ndarray],
        ranked: Sequence[Distances],
        pose: Distances,
        sound: Distances,
    ) -> None:
        self._starts, self._ranked = starts, ranked
        self._frames, listed, count = (
            np.empty(len(starts), np.uint64),
            np.empty(len(starts), np.int64),
            np.empty(1, np.int64),
        )
        bounds: list[np.ndarray | None] = [bound for by in ranked for bound in (by.near, by.far)]
        self._known = [len(starts), self._frames, *bounds, *[None] * (4 - len(bounds))]
        settings = int(ranked[0] is sound), np.ascontiguousarray(mask, bool), k
        contenders = call("find", *self._known, *settings, *tables, pose.query, sound.query, listed, count)
        # Contenders first: once they are known, few others are left that their ranks depend on.
        self._look_up(listed[: count[0]])
        self._contenders = listed[:contenders][self._frames[listed[:contenders]] != 0]

    @property
    def candidates(self) -> int:
        """How many sequences have an eligible frame."""
        return int(np.count_nonzero(self._frames))

    def winner(self, k: int) -> int:
        """The sequence with the k-th smallest sum of ranks; there must be as many candidates."""
        contenders = self._contenders
        if len(contenders) == 1:
            return int(contenders[0])
        listed = np.empty(len(self._frames), np.int64)
        undecided = listed[: call("list_undecided", *self._known, contenders, len(contenders), listed)]
        by = self._ranked[0]
        self._look_up(undecided[by.near[undecided] != by.far[undecided]])
        sums = np.zeros(len(self._frames), np.int64)
        for by in self._ranked:
            order = contenders[np.argsort(by.near[contenders], kind="stable")]
            before = np.zeros(len(order), np.int64)
            call("count_before", by.near[order], order, len(order), by.far, len(sums), self._frames, before)
            sums[order] += before.cumsum()
        return int(contenders[np.argsort(sums[contenders], kind="stable")[k - 1]])

    def frame(self, contender: int) -> int:
        """The frame that a contender shows."""
        return int(self._frames[contender]).bit_length() - 1

    def _look_up(self, sequences: np.ndarray) -> None:
        """Compare some sequences in full. A distance of 0 is the query's own frame, and skipped."""
        bits = np.unpackbits(self._frames[sequences, None].view(np.uint8), axis=1, bitorder="little") > 0
        rows = self._starts[sequences, None] + np.arange(SEQUENCE)
        distances = np.full(bits.shape, np.inf)
        distances[bits] = self._ranked[0].exact(rows[bits])
        distances[distances == 0] = np.inf
        nearest, frame = distances.min(axis=1), distances.argmin(axis=1)
        self._ranked[0].know(sequences, nearest)
        self._frames[sequences] = np.where(np.isfinite(nearest), np.uint64(1) << frame.astype(np.uint64), 0)
        for by in self._ranked[1:]:
            by.know(sequences, by.exact(self._starts[sequences] + frame))
