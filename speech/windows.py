"""Overlapping windows of a loudness-normalised signal that arrives bit by bit."""

import numpy as np

from gesture_bot.speech.audio import check_samples
from gesture_bot.speech.loudness import LoudnessNormaliser

WINDOW_LENGTH = 400
"""Samples in a window (25 ms)."""

HOP = 160
"""Samples from one window to the next (10 ms)."""


class WindowStream:
    """Cuts a signal into windows; the same for any division into pieces.

    Args:
        loudness: Of what the speaker said before, which goes on; otherwise the speaker is new.
    """

    def __init__(self, loudness: LoudnessNormaliser | None = None) -> None:
        self._loudness = loudness or LoudnessNormaliser()
        self._loudness.begin()
        self._signal = np.zeros(0)

    def push(self, samples: np.ndarray) -> np.ndarray:
        """Take in the next samples.

        Args:
            samples: (n,) mono samples at audio.SAMPLE_RATE, full scale 1; any n.

        Returns:
            (m, WINDOW_LENGTH) float64: the windows that they complete.

        Raises:
            InvalidValueError: The samples are not one channel of finite numbers; the stream is as before.
        """
        check_samples(samples)
        signal = np.concatenate([self._signal, self._loudness.push(samples)])
        count = max(0, 1 + (len(signal) - WINDOW_LENGTH) // HOP)
        self._signal = signal[count * HOP :]
        if not count:
            return np.zeros((0, WINDOW_LENGTH))
        return np.lib.stride_tricks.sliding_window_view(signal, WINDOW_LENGTH)[::HOP]
