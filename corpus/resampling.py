"""From any frame rate to 15 frames a second."""

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt

from gesture_bot.base.frames import FRAME_RATE

CUTOFF = 6.5
"""Half-power frequency of the low-pass [Hz]: below half of 15, above what gestures hold."""


def to_frame_rate(keypoints: np.ndarray, rate: float) -> np.ndarray:
    """Keypoints at FRAME_RATE, the first frame at the same moment.

    From faster sources a low-pass takes out what 15 frames a second cannot hold: a Butterworth filter of
    fourth order, run forward and backward so that nothing is delayed. Cubic splines pass through the rest.

    Args:
        keypoints: (n, 17, 3) positions, n >= 2, none NaN.
        rate: Their frames a second.
    """
    if rate > FRAME_RATE:
        low_pass = butter(4, CUTOFF, fs=rate, output="sos")
        keypoints = sosfiltfilt(low_pass, keypoints, axis=0, padlen=min(len(keypoints) - 1, round(rate)))
    count = frames_until(len(keypoints) - 1, rate)
    return CubicSpline(np.arange(len(keypoints)) / rate, keypoints)(np.arange(count) / FRAME_RATE)


def frames_until(last: int, rate: float) -> int:
    """How many frames at FRAME_RATE are seen up to a frame at another rate, that moment included."""
    return int(last / rate * FRAME_RATE + 1e-6) + 1
