"""Who wins a search: from bounds of distances to bounds of ranks, and in full only where that leaves doubt."""

from dataclasses import dataclass, field

import numpy as np

from gesture_bot.corpus.database import SEQUENCE
from gesture_bot.matching import kernels
from gesture_bot.matching.features import Stream


@dataclass
class Distances:
    """The distances of all sequences from a query, by one stream; a known one is its own bound.

    Attributes:
        stream: Poses or sounds.
        query: The feature searched for.
        near: (S,) float64 bound from below.
        far: (S,) float64 bound from above.
    """

    stream: Stream
    query: np.ndarray
    near: np.ndarray = field(init=False)
    far: np.ndarray = field(init=False)

    def exact(self, rows: np.ndarray) -> np.ndarray:
        """Distances of the features that begin at some rows."""
        return self.stream.distance(self.stream.at(rows), self.query)

    def know(self, sequences: np.ndarray, distances: np.ndarray) -> None:
        """Take in the distances of some sequences."""
        self.near[sequences] = self.far[sequences] = distances


class Contest:
    """One search.

    Attributes:
        ranked: Distances by which sequences are ranked.
        frame: (S,) frame of each sequence, where it is known.

    Args:
        starts: (S,) rows at which the sequences begin.
        frames: (S,) uint64 bits of the frames that may be a sequence's nearest; none: the sequence is out.
        chosen: Distances by which the frame within a sequence is chosen; the first of `ranked`.
    """

    def __init__(self, starts: np.ndarray, frames: np.ndarray, chosen: Distances) -> None:
        self._starts, self._frames, self._chosen = starts, frames, chosen
        self._settled = np.zeros(len(starts), bool)
        self.ranked = [chosen]
        self.frame = np.zeros(len(starts), np.int64)

    def choose(self, sequences: np.ndarray) -> None:
        """Find the nearest frame of some sequences. A distance of 0 is the query's own frame, and skipped."""
        bits = np.unpackbits(self._frames[sequences, None].view(np.uint8), axis=1, bitorder="little") > 0
        rows = self._starts[sequences, None] + np.arange(SEQUENCE)
        distances = np.full(bits.shape, np.inf)
        distances[bits] = self._chosen.exact(rows[bits])
        distances[distances == 0] = np.inf
        nearest, frame = distances.min(axis=1), distances.argmin(axis=1)
        self._chosen.know(sequences, nearest)
        self.frame[sequences] = frame
        self._frames[sequences] = np.where(np.isfinite(nearest), np.uint64(1) << frame.astype(np.uint64), 0)

    def winner(self, k: int) -> int:
        """The sequence with the k-th smallest sum of ranks; there must be as many."""
        self._settle(self._contenders(k))
        contenders = self._contenders(k)
        orders = [contenders[np.argsort(by.near[contenders], kind="stable")] for by in self.ranked]
        crossed = np.zeros(len(self._frames), bool)
        for by, order in zip(self.ranked, orders, strict=True):
            crossed |= kernels.crossing(by.near[order], by.near, by.far, self._frames)
        self._settle(np.flatnonzero(crossed))

        sums = np.zeros(len(self._frames), np.int64)
        for by, order in zip(self.ranked, orders, strict=True):
            sums[order] += kernels.ranks_among(by.near[order], order, by.far, self._frames)
        return int(contenders[np.argsort(sums[contenders], kind="stable")[k - 1]])

    def _contenders(self, k: int) -> np.ndarray:
        """The sequences that may have one of the k smallest sums of ranks, in their order."""
        out = np.where(self._frames == 0, 4 * len(self._frames), 0)
        fewest, most = out, out.copy()
        for by in self.ranked:
            kernels.add_rank_bounds(by.near, by.far, self._frames, fewest, most)
        return np.flatnonzero(fewest <= np.partition(most, k - 1)[k - 1])

    def _settle(self, sequences: np.ndarray) -> None:
        """Compare some sequences in full."""
        sequences = sequences[~self._settled[sequences]]
        self._settled[sequences] = True
        self.choose(sequences)
        for by in self.ranked[1:]:
            by.know(sequences, by.exact(self._starts[sequences] + self.frame[sequences]))
