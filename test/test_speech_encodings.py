"""Sound as bytes and numbers of many formats comes out as the sound that went in."""

import io

import numpy as np
import pytest
import soundfile

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.speech.encodings import FORMATS, from_bytes, from_numbers

SOUND = np.column_stack([np.sin(np.arange(800) / 9), 0.5 * np.cos(np.arange(800) / 5)])
MONO = SOUND.mean(axis=1)
SUBTYPES = {
    "S8": "PCM_S8",
    "U8": "PCM_U8",
    "S1": "PCM_16",
    "S2": "PCM_24",
    "S3": "PCM_32",
    "F3": "FLOAT",
    "F6": "DOUBLE",
}


@pytest.mark.parametrize("name", FORMATS)
def test_bytes(name):
    file = io.BytesIO()
    endian = "BIG" if name.endswith("BE") else "LITTLE"
    soundfile.write(file, SOUND, 16_000, format="RAW", subtype=SUBTYPES[name[:2]], endian=endian)
    np.testing.assert_allclose(from_bytes(file.getvalue(), name, 2), MONO, atol=0.01 if "8" in name else 1e-4)


@pytest.mark.parametrize("kind", ["float32", "int32", "int16", "int8", "uint8"])
def test_numbers(kind):
    if kind == "float32":
        numbers = SOUND
    else:
        limits = np.iinfo(kind)
        middle = 0 if limits.min else 127.5
        numbers = np.round(SOUND * (limits.max - middle) + middle)
    mono = from_numbers(numbers.ravel().astype(kind), 2)
    np.testing.assert_allclose(mono, MONO, atol=0.01 if "8" in kind else 1e-4)


def test_what_cannot_be_read_is_named():
    with pytest.raises(InvalidValueError, match="'A52'; valid: S8, U8, S16LE"):
        from_bytes(b"", "A52", 1)
    with pytest.raises(InvalidValueError, match="channels: 0"):
        from_numbers(np.zeros(4, np.int16), 0)
    with pytest.raises(InvalidValueError, match="no multiple of 2 channels: 3"):
        from_numbers(np.zeros(3, np.int16), 2)
