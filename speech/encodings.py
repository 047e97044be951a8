"""Sound as other packages' messages carry it: bytes or numbers of many formats, any number of channels."""

import io

import numpy as np
import soundfile

from gesture_bot.base.errors import InvalidValueError

_SUBTYPES = {
    "S8": "PCM_S8",
    "U8": "PCM_U8",
    "S16": "PCM_16",
    "S24": "PCM_24",
    "S32": "PCM_32",
    "F32": "FLOAT",
    "F64": "DOUBLE",
}
_ENDS = {"": "LITTLE", "LE": "LITTLE", "BE": "BIG"}

CHANNELS = 256
"""Most channels that sound may have."""

FORMATS = tuple(f"{name}{end}" for name in _SUBTYPES for end in (("",) if name[1:] == "8" else ("LE", "BE")))
"""Names of sample formats, as GStreamer writes them."""


def from_bytes(data: bytes, sample_format: str, channels: int) -> np.ndarray:
    """Raw bytes -> (n,) float32, full scale 1, channels averaged.

    Args:
        data: Interleaved samples.
        sample_format: One of FORMATS.
        channels: How many.

    Raises:
        InvalidValueError: The format is unknown, or the number of channels is.
    """
    if sample_format not in FORMATS:
        raise InvalidValueError("unknown sample format", sample_format, FORMATS)
    _check(channels)
    width = 2 if sample_format[1:] == "8" else 3
    sound, _ = soundfile.read(
        io.BytesIO(data),
        dtype="float32",
        always_2d=True,
        format="RAW",
        samplerate=1,
        channels=channels,
        subtype=_SUBTYPES[sample_format[:width]],
        endian=_ENDS[sample_format[width:]],
    )
    return sound.mean(axis=1)


def from_numbers(samples: np.ndarray, channels: int) -> np.ndarray:
    """Interleaved integers or floats -> (n,) float32, full scale 1, channels averaged.

    Raises:
        InvalidValueError: There is no channel, or the samples are not a multiple of them.
    """
    _check(channels)
    if len(samples) % channels:
        raise InvalidValueError(f"the number of samples is no multiple of {channels} channels", len(samples))
    sound = samples.astype(np.float32)
    if samples.dtype.kind != "f":
        full_scale = np.float32(2 ** (8 * samples.dtype.itemsize - 1))
        sound = (sound - (full_scale if samples.dtype.kind == "u" else 0)) / full_scale
    return sound.reshape(-1, channels).mean(axis=1)


def _check(channels: int) -> None:
    if not 1 <= channels <= CHANNELS:
        raise InvalidValueError("number of channels", channels, [f"1 to {CHANNELS}"])
