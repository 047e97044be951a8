"""Who wins a search: bounds of distances give bounds of ranks; where they leave doubt, it is looked up."""

from dataclasses import dataclass, field

import numpy as np

from gesture_bot.corpus.database import SEQUENCE
from gesture_bot.matching.features import Stream
from gesture_bot.matching.kernels import call, pointer


@dataclass(eq=False)
class Distances:
    """The distances of all sequences from a query, by one stream; a known one is its own bound.

    Attributes:
        stream: Poses or sounds.
        query: The feature searched for.
        coded: Both for kernels.cpp; see FrameCodes.coded.
        near: (S,) float64 bound from below.
        far: (S,) float64 bound from above.
    """

    stream: Stream
    query: np.ndarray
    coded: tuple[np.ndarray, np.ndarray]
    near: np.ndarray = field(init=False)
    far: np.ndarray = field(init=False)

    def exact(self, rows: np.ndarray) -> np.ndarray:
        """Distances of the features that begin at some rows."""
        return self.stream.distance(self.stream.at(rows), self.query)

    def know(self, sequences: np.ndarray, distances: np.ndarray) -> None:
        """Take in the distances of some sequences."""
        self.near[sequences] = self.far[sequences] = distances


class Contest:
    """One search: bounds first, and then whatever they leave open.

    Attributes:
        candidates: How many sequences have an eligible frame.
        frame: (S,) frame of each sequence, where it is known.

    Args:
        starts: (S,) rows at which the sequences begin.
        mask: (S, 64) bool control mask.
        ranked: One or two, by the first of which the frame within a sequence is chosen.
        poses: Where that is by pose, the codes to begin with, and the query in their numbers.
    """

    def __init__(
        self,
        starts: np.ndarray,
        mask: np.ndarray,
        ranked: list[Distances],
        poses: tuple[np.ndarray, np.ndarray] | None,
    ) -> None:
        self._starts, self._ranked = starts, ranked
        coded = [pointer(one) for by in ranked for one in by.coded] + [None] * (4 - 2 * len(ranked))
        self._finer = coded if poses else [None] * 4
        self._frames, bounds = np.empty(len(starts), np.uint64), np.empty((2 * len(ranked), len(starts)))
        for by, near, far in zip(ranked, bounds[::2], bounds[1::2], strict=True):
            by.near, by.far = near, far
        absent = [None] * (4 - len(bounds))
        self._bounds = [len(starts), pointer(self._frames), *map(pointer, bounds), *absent]
        allowed = np.ascontiguousarray(mask, bool)
        search = "search_poses" if poses else "search_sounds"
        call(search, *(poses or coded[:2]), *coded[2:], allowed, *self._bounds)
        self._settled = np.zeros(len(starts), bool)
        self.frame = np.empty(len(starts), np.int64)
        self.choose(np.flatnonzero((ranked[0].near == 0) & (self._frames != 0)))
        self.candidates = int(np.count_nonzero(self._frames))

    @property
    def compared(self) -> int:
        """Sequences whose distances were looked up in full."""
        return int(np.count_nonzero(self._settled))

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
        contenders = self._listed("find_contenders", k, *self._finer)
        self._settle(contenders)
        if len(contenders) == 1:
            return int(contenders[0])
        self._settle(self._listed("list_crossing", contenders, len(contenders)))

        sums = np.zeros(len(self._frames), np.int64)
        for by in self._ranked:
            order = contenders[np.argsort(by.near[contenders], kind="stable")]
            before = np.zeros(len(order), np.int64)
            call(
                "count_before", by.near[order], order, len(order), by.far, len(sums), self._frames, before
            )
            sums[order] += before.cumsum()
        return int(contenders[np.argsort(sums[contenders], kind="stable")[k - 1]])

    def _listed(self, name: str, *arguments: np.ndarray | int | None) -> np.ndarray:
        """Sequences that a function of kernels.cpp lists."""
        sequences = np.empty(len(self._frames), np.int64)
        return sequences[: call(name, *self._bounds, *arguments, sequences)]

    def _settle(self, sequences: np.ndarray) -> None:
        """Compare some sequences in full."""
        sequences = sequences[~self._settled[sequences]]
        self._settled[sequences] = True
        self.choose(sequences)
        for by in self._ranked[1:]:
            by.know(sequences, by.exact(self._starts[sequences] + self.frame[sequences]))
