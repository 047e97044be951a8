"""Sound that waits for the moment at which it is heard, for a sound card that asks for it block by block."""

import threading
from collections import deque
from collections.abc import Iterator

import numpy as np

DRIFT = 0.02
"""A sound card's clock that has gone this far from the time of the sound is set right [s]."""


class Playback:
    """A buffer between those who know when a sound is due and a sound card with a clock of its own.

    It may be filled in one thread and read in another.

    Args:
        rate: Samples a second, of the sound put in and read out.
    """

    def __init__(self, rate: int) -> None:
        self.rate = rate
        self._pieces: deque[tuple[float, np.ndarray]] = deque()
        self._lock = threading.Lock()
        self._next = -np.inf

    def put(self, moment: float, samples: np.ndarray) -> None:
        """Play samples (n,) from a moment on [s since the epoch]; not before what was put in earlier."""
        if len(samples):
            with self._lock:
                self._pieces.append((moment, samples))

    def cut(self, moment: float) -> None:
        """Play nothing of what was put in so far from a moment on [s since the epoch]."""
        with self._lock:
            kept = []
            for begin, samples in self._pieces:
                left = max(0, round((moment - begin) * self.rate))
                if left:
                    kept.append((begin, samples[:left]))
            self._pieces = deque(kept)

    def read(self, moment: float, count: int) -> np.ndarray:
        """The next samples that the sound card plays.

        The clock of the last call goes on as long as it is within DRIFT of `moment`, so that the jitter of
        the card's own estimate is not heard.

        Args:
            moment: When the first of them is heard, as the sound card estimates it [s since the epoch].
            count: How many.

        Returns:
            (count,) float32, silence where nothing is due.
        """
        if abs(moment - self._next) > DRIFT:
            self._next = moment
        block = np.zeros(count, np.float32)
        with self._lock:
            for begin, samples in self._due(self._next + count / self.rate):
                first = round((begin - self._next) * self.rate)
                heard = samples[max(0, -first) : count - first]
                place = max(0, first)
                block[place : place + len(heard)] = heard
        self._next += count / self.rate
        return block

    def _due(self, end: float) -> Iterator[tuple[float, np.ndarray]]:
        """Pieces that begin before a moment; those that are over by then are gone afterwards."""
        over = 0
        for begin, samples in self._pieces:
            if begin >= end:
                break
            over += begin + len(samples) / self.rate <= end
            yield begin, samples
        for _ in range(over):
            self._pieces.popleft()
