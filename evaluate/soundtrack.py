"""All that was heard over a while, on one track."""

from collections import defaultdict

import numpy as np
import soxr

from gesture_bot.speech.cuts import Cuts
from gesture_bot.speech.playback import Playback


class Soundtrack:
    """Takes pieces of sound and cuts in the order in which they were sent, as the loudspeaker does.

    Sources that are heard together are mixed.
    """

    def __init__(self) -> None:
        self._tracks: dict[str, dict[int, Playback]] = defaultdict(dict)
        self._cuts = Cuts()

    def put(self, source: str, utterance: int, moment: float, samples: np.ndarray, rate: int) -> None:
        """Take a piece of an utterance: (n,) samples, heard from a moment on [s since the epoch]."""
        if not self._cuts.void(source, utterance, moment):
            self._tracks[source].setdefault(rate, Playback(rate)).put(moment, samples, utterance)

    def cut(self, source: str, utterance: int, moment: float) -> None:
        """Utterances of a source, up to one, are not heard from a moment on [s since the epoch]."""
        self._cuts.add(source, utterance, moment)
        for playback in self._tracks[source].values():
            playback.cut(moment, utterance)

    def mix(self, begin: float, duration: float, rate: int) -> np.ndarray:
        """(duration * rate,) float32 samples from a moment on [s since the epoch]. It can be had once."""
        mixed = np.zeros(round(duration * rate), np.float32)
        for tracks in self._tracks.values():
            for own_rate, playback in tracks.items():
                heard = playback.read(begin, round(duration * own_rate))
                if own_rate != rate:
                    heard = soxr.resample(heard, own_rate, rate)
                mixed[: len(heard)] += heard[: len(mixed)]
        return np.clip(mixed, -1.0, 1.0)
