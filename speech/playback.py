"""Sound that waits for the moment at which it is heard, for a sound card that asks for it block by block."""

import threading

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
        self._pieces: list[tuple[float, np.ndarray, int]] = []
        self._lock = threading.Lock()
        self._next = -np.inf

    def put(self, moment: float, samples: np.ndarray, utterance: int = 0) -> None:
        """Play samples (n,) of an utterance from a moment on [s since the epoch]."""
        if len(samples):
            with self._lock:
                self._pieces.append((moment, samples, utterance))

    def cut(self, moment: float, utterance: int) -> None:
        """Play nothing of the utterances up to one from a moment on [s since the epoch]."""
        with self._lock:
            kept = []
            for begin, samples, number in self._pieces:
                left = max(0, round((moment - begin) * self.rate)) if number <= utterance else len(samples)
                if left:
                    kept.append((begin, samples[:left], number))
            self._pieces = kept

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
            waiting = []
            for piece in self._pieces:
                first = round((piece[0] - self._next) * self.rate)
                if first < count:
                    heard = piece[1][max(0, -first) : count - first]
                    place = max(0, first)
                    block[place : place + len(heard)] = heard
                if first + len(piece[1]) > count:
                    waiting.append(piece)
            self._pieces = waiting
        self._next += count / self.rate
        return block
