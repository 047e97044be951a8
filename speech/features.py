"""Speech features at 15 Hz: 13 MFCC, the log mean energy, and their first derivative (MM22).

The MFCC of a window are those of librosa with the settings below, center=False and top_db=None, on the
loudness-normalised signal: periodic Hann window, power spectrum, Slaney's mel filters, dB, orthonormal DCT.
"""

import numpy as np
from scipy.fft import dct, rfft

from gesture_bot.base.frames import FRAME_RATE
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.loudness import LoudnessNormaliser, decibels
from gesture_bot.speech.windows import HOP, WINDOW_LENGTH, WindowStream

COEFFICIENTS = 13
"""MFCC in a frame."""

STATIC = COEFFICIENTS + 1
"""Features without derivatives: the MFCC and the log mean energy [dB]. They come first in a frame."""

FEATURES = 2 * STATIC
"""Features in a frame; the derivatives are differences to the frame before, 0 in the first."""

MELS = 40
"""Mel filters, from 0 Hz to half the sample rate."""

_PIECE = 60 * SAMPLE_RATE

FLOOR = -60.0
"""Least power of a mel filter and least mean energy [dB]. Room noise and digital silence then look alike."""


def speech_features(samples: np.ndarray) -> np.ndarray:
    """Features of a whole recording; a last frame that is not full is filled up with silence.

    Args:
        samples: (n,) mono samples at audio.SAMPLE_RATE, full scale 1.

    Returns:
        (ceil(n / SAMPLE_RATE * FRAME_RATE), FEATURES) float32.

    Raises:
        InvalidValueError: The samples are not one channel of finite numbers.
    """
    stream = FeatureStream()
    # The windows of a whole hour at once would be gigabytes.
    begins = range(0, len(np.atleast_1d(samples)), _PIECE)
    pieces = [stream.push(samples[begin : begin + _PIECE]) for begin in begins]
    return np.concatenate([*pieces, stream.flush()])


class FeatureStream:
    """Features of a signal that arrives bit by bit, the same as speech_features of the whole.

    Frame k lasts from k / 15 s to (k + 1) / 15 s. It is the mean over the 6 or 7 windows whose centre lies in
    it, and is complete at most 17.5 ms after its end.

    Args:
        loudness: Of what the speaker said before, which goes on; otherwise the speaker is new.
    """

    def __init__(self, loudness: LoudnessNormaliser | None = None) -> None:
        self._stream = WindowStream(loudness)
        self._received = 0
        self._frame = 0
        self._windows = np.zeros((0, STATIC))
        self._last: np.ndarray | None = None

    def push(self, samples: np.ndarray) -> np.ndarray:
        """Take in the next samples.

        Args:
            samples: (n,) mono samples at audio.SAMPLE_RATE, full scale 1; any n.

        Returns:
            (m, FEATURES) float32, the frames that they complete.

        Raises:
            InvalidValueError: The samples are not one channel of finite numbers; the stream is as before.
        """
        windows = self._stream.push(samples)
        self._received += len(samples)
        self._windows = np.concatenate([self._windows, _window_features(windows)])
        return self._complete_frames()

    def flush(self) -> np.ndarray:
        """End the signal: the frames up to its last sample, filled up with silence, (m, FEATURES) float32."""
        missing = -(-self._received * FRAME_RATE // SAMPLE_RATE) - self._frame
        silence = np.zeros(missing * SAMPLE_RATE // FRAME_RATE + 2 * WINDOW_LENGTH)
        return self.push(silence)[:missing]

    def _complete_frames(self) -> np.ndarray:
        frames = []
        while len(self._windows) >= (count := _first_window(self._frame + 1) - _first_window(self._frame)):
            static = self._windows[:count].mean(axis=0)
            static[COEFFICIENTS] = decibels(static[COEFFICIENTS], FLOOR)
            self._windows = self._windows[count:]
            frames.append(np.concatenate([static, static - (static if self._last is None else self._last)]))
            self._last = static
            self._frame += 1
        return np.array(frames, np.float32).reshape(-1, FEATURES)


def _first_window(frame: int) -> int:
    """The first window whose centre, HOP * window + WINDOW_LENGTH / 2, lies in a frame; exact in integers."""
    return max(0, -(-(2 * frame * SAMPLE_RATE - FRAME_RATE * WINDOW_LENGTH) // (2 * FRAME_RATE * HOP)))


def _window_features(windows: np.ndarray) -> np.ndarray:
    """MFCC and mean energy of each window: (n, WINDOW_LENGTH) -> (n, STATIC)."""
    mfcc = dct(mel_decibels(windows), norm="ortho")[:, :COEFFICIENTS]
    return np.column_stack([mfcc, np.mean(windows**2, axis=1)])


def mel_decibels(windows: np.ndarray) -> np.ndarray:
    """Power of each window in each mel filter, at least FLOOR: (n, WINDOW_LENGTH) -> (n, MELS) [dB]."""
    return decibels(np.abs(rfft(windows * _HANN)) ** 2 @ _MEL_FILTERS.T, FLOOR)


def mel_filters() -> np.ndarray:
    """The mel filters of Slaney's Auditory Toolbox (1998), (MELS, WINDOW_LENGTH // 2 + 1).

    Mels are linear below 1 kHz and logarithmic above, and every filter has the same area. They equal those of
    librosa.filters.mel, which takes seconds to import.
    """
    step = np.log(6.4) / 27
    mels = np.linspace(0, 15 + np.log(SAMPLE_RATE / 2 / 1000) / step, MELS + 2)
    corners = np.where(mels < 15, mels * 200 / 3, 1000 * np.exp(step * (mels - 15)))
    frequencies = np.fft.rfftfreq(WINDOW_LENGTH, 1 / SAMPLE_RATE)
    low, centre, high = corners[:-2, None], corners[1:-1, None], corners[2:, None]
    triangles = np.minimum((frequencies - low) / (centre - low), (high - frequencies) / (high - centre))
    return np.maximum(0, triangles) * 2 / (high - low)


_HANN = np.hanning(WINDOW_LENGTH + 1)[:-1]  # periodic
_MEL_FILTERS = mel_filters()

SILENCE_FEATURES = speech_features(np.zeros(SAMPLE_RATE // FRAME_RATE, np.float32))[0]
"""(FEATURES,) float32: a silent frame after a silent frame."""
