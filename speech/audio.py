"""Recordings from files, as the mono 16 kHz signal that every speech computation works on."""

from pathlib import Path

import numpy as np
import soundfile
import soxr

from gesture_bot.base.errors import FileFormatError, InvalidValueError

SAMPLE_RATE = 16_000
"""Samples a second (MM22)."""


def load_audio(path: str | Path) -> np.ndarray:
    """Read a sound file of any rate and channel count (WAV, FLAC, OGG, and what else libsndfile reads).

    Returns:
        (n,) float32 mono samples at SAMPLE_RATE, channels averaged, full scale 1.

    Raises:
        FileFormatError: The file is missing, is no sound file, or holds no samples, NaN or
            infinite ones.
    """
    try:
        samples, rate = soundfile.read(path, dtype="float32", always_2d=True)
    except (OSError, soundfile.LibsndfileError) as error:
        reason = "no such file" if not Path(path).exists() else getattr(error, "error_string", str(error))
        raise FileFormatError(f"cannot read {path} as sound ({reason.rstrip('.')})") from error
    if len(samples) == 0:
        raise FileFormatError(f"{path} holds no samples")
    if not np.isfinite(samples).all():
        raise FileFormatError(f"{path} holds samples that are not finite numbers")
    return soxr.resample(samples.mean(axis=1), rate, SAMPLE_RATE)


def check_samples(samples: np.ndarray) -> None:
    """Refuse what is no signal.

    Raises:
        InvalidValueError: The samples are not one channel of finite numbers.
    """
    if np.ndim(samples) != 1:
        raise InvalidValueError("samples are not one channel, shape", np.shape(samples))
    if not np.isfinite(samples).all():
        raise InvalidValueError("samples are not all finite numbers")
