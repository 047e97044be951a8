"""Who wins a search: bounds of distances give bounds of ranks; where they leave doubt, it is looked up."""

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

    def arguments(self) -> tuple[np.ndarray, ...]:
        """For kernels.cpp: stream, query, and bounds."""
        return self.stream.addresses, self.query, self.near, self.far

    def know(self, sequences: np.ndarray, distances: np.ndarray) -> None:
        """Take in the distances of some sequences."""
        self.near[sequences] = self.far[sequences] = distances


class Contest:
    """One search.

    Attributes:
        frame: (S,) frame of each sequence, where it is known.

    Args:
        starts: (S,) rows at which the sequences begin.
        frames: (S,) uint64 bits of the frames that may be a sequence's nearest; none: the sequence is out.
        ranked: One or two, by the first of which the frame within a sequence is chosen.
    """

    def __init__(self, starts: np.ndarray, frames: np.ndarray, ranked: list[Distances]) -> None:
        self._starts, self._frames, self._ranked = starts, frames, ranked
        self._refined, self._settled = np.zeros(len(starts), np.uint8), np.zeros(len(starts), bool)
        self.frame = np.zeros(len(starts), np.int64)

    @property
    def compared(self) -> int:
        """Sequences whose distances were looked up in full."""
        return int(np.count_nonzero(self._refined))

    def choose(self, sequences: np.ndarray) -> None:
        """Find the nearest frame of some sequences. A distance of 0 is the query's own frame, and skipped."""
        bits = np.unpackbits(self._frames[sequences, None].view(np.uint8), axis=1, bitorder="little") > 0
        rows = self._starts[sequences, None] + np.arange(SEQUENCE)
        distances = np.full(bits.shape, np.inf)
        distances[bits] = self._ranked[0].exact(rows[bits])
        distances[distances == 0] = np.inf
        nearest, frame = distances.min(axis=1), distances.argmin(axis=1)
        self._ranked[0].know(sequences, nearest)
        self.frame[sequences] = frame
        self._frames[sequences] = np.where(np.isfinite(nearest), np.uint64(1) << frame.astype(np.uint64), 0)

    def winner(self, k: int) -> int:
        """The sequence with the k-th smallest sum of ranks; there must be as many."""
        everything = np.uint8(2 ** len(self._ranked) - 1)
        wanted = np.zeros(len(self._frames), np.uint8)
        wanted[self._contenders(k)] = everything
        self._refine(wanted)
        self._refine(self._crossing(self._contenders(k)))

        # What double precision cannot tell apart is compared as the reference does it.
        contenders = self._contenders(k)
        self._settle(contenders)
        if len(contenders) == 1:
            return int(contenders[0])
        self._settle(np.flatnonzero(self._crossing(contenders)))

        sums = np.zeros(len(self._frames), np.int64)
        for by in self._ranked:
            order = contenders[np.argsort(by.near[contenders], kind="stable")]
            before = np.zeros(len(order), np.int64)
            kernels.call(
                "count_before", by.near[order], order, len(order), by.far, len(sums), self._frames, before
            )
            sums[order] += before.cumsum()
        return int(contenders[np.argsort(sums[contenders], kind="stable")[k - 1]])

    def _contenders(self, k: int) -> np.ndarray:
        """The sequences that may have one of the k smallest sums of ranks, in their order."""
        sequences = len(self._frames)
        bounds = [bound for by in self._ranked for bound in (by.near, by.far)]
        counts, contenders = np.empty((2, sequences), np.int32), np.empty(sequences, np.int64)
        count = kernels.call(
            "list_contenders",
            k,
            sequences,
            self._frames,
            *bounds,
            *[None] * (4 - len(bounds)),
            counts,
            contenders,
        )
        return contenders[:count]

    def _crossing(self, contenders: np.ndarray) -> np.ndarray:
        """(S,) uint8 bits of the distances whose bounds meet those of a contender: that rank is open."""
        crossed = np.zeros(len(self._frames), np.uint8)
        for place, by in enumerate(self._ranked):
            lows, highs = np.sort(by.near[contenders]), np.sort(by.far[contenders])
            intervals = lows, highs, len(lows)
            bounds = by.near, by.far, len(crossed)
            kernels.call("mark_crossing", *intervals, *bounds, self._frames, 1 << place, crossed)
        return crossed

    def _refine(self, wanted: np.ndarray) -> None:
        """Bound distances in double precision: those of the bits (S,), as in _crossing, unless they are."""
        wanted = wanted & ~self._refined
        self._refined |= wanted
        sequences = np.flatnonzero(wanted)
        arguments: list[np.ndarray | None] = [one for by in self._ranked for one in by.arguments()]
        arguments += [None] * (8 - len(arguments))
        kernels.call("refine", *arguments, self._starts, sequences, len(sequences), wanted, self._frames)

    def _settle(self, sequences: np.ndarray) -> None:
        """Compare some sequences in full."""
        sequences = sequences[~self._settled[sequences]]
        self._settled[sequences] = True
        self.choose(sequences)
        for by in self._ranked[1:]:
            by.know(sequences, by.exact(self._starts[sequences] + self.frame[sequences]))
