"""Onsets of sound in a stream: librosa's onset strength and peak picking, without a look at the whole file.

librosa divides the strength by its maximum over the file. Here the signal has the loudness of speech (see
loudness.py), so that the strength in dB, and a threshold in dB, mean the same from the first word on.
"""

import numpy as np

from gesture_bot.speech.features import MELS, mel_decibels

BEFORE, AFTER = 3, 3
"""An onset is the strongest among so many windows before and after it (30 ms)."""

AVERAGED = 10
"""Windows before and after an onset whose mean strength it exceeds (0.1 s)."""

THRESHOLD = 1.5
"""By so much an onset exceeds that mean [dB]: about 0.07, librosa's threshold, of what speech reaches."""

WAIT = 3
"""Windows after an onset that are passed over (30 ms)."""


class OnsetStream:
    """Finds the windows at which sound sets in; each is known AVERAGED windows later."""

    def __init__(self) -> None:
        self._last = np.full((1, MELS), np.inf)  # nothing is known to rise in the first window
        self._strength = np.zeros(0)
        self._first = 0  # the window that the first strength kept belongs to
        self._next = 1  # the next window that may be an onset

    @property
    def known(self) -> int:
        """All onsets before this window are known."""
        return self._next

    def push(self, windows: np.ndarray) -> list[int]:
        """Take in the next windows (n, WINDOW_LENGTH); the indices of the onsets that are known with them."""
        levels = np.concatenate([self._last, mel_decibels(windows)])
        rises = np.maximum(0, np.diff(levels, axis=0)).mean(axis=1)
        self._last = levels[-1:]
        self._strength = np.concatenate([self._strength, rises])
        onsets = []
        while (place := self._next - self._first) + AVERAGED < len(self._strength):
            if self._is_onset(place):
                onsets.append(self._next)
                self._next += WAIT
            self._next += 1
        passed = max(0, self._next - AVERAGED - self._first)
        self._strength, self._first = self._strength[passed:], self._first + passed
        return onsets

    def _is_onset(self, place: int) -> bool:
        strength = self._strength[place]
        around = self._strength[max(0, place - BEFORE) : place + AFTER + 1]
        averaged = self._strength[max(0, place - AVERAGED) : place + AVERAGED + 1]
        return bool(strength == around.max() and strength >= averaged.mean() + THRESHOLD)
