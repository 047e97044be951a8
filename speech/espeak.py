"""The C API of espeak-ng: a text in any of its languages becomes samples and timed phonemes.

espeak-ng is GPL-3. It comes with the extra `espeak` (the wheel espeakng-loader) and is loaded only here.
"""

import ctypes
from _ctypes import dlclose
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from itertools import count, takewhile
from threading import Lock
from typing import Any

import numpy as np
import soxr

from gesture_bot.base.errors import GestureBotError
from gesture_bot.speech.audio import SAMPLE_RATE

# From espeak-ng's speak_lib.h.
_SYNCHRONOUS, _MILLISECONDS = 2, 200
_PHONEME_EVENTS, _IPA, _DONT_EXIT = 0x1, 0x2, 0x8000
_WORD_EVENT, _PHONEME_EVENT = 1, 7
_RATE, _PITCH, _RANGE = 1, 3, 4
_CHARACTERS, _UTF8 = 1, 1


@dataclass(frozen=True)
class Sound:
    """A phoneme, or a pause, which has no name."""

    ipa: str
    start: float
    end: float


@dataclass(frozen=True)
class Event:
    """What espeak-ng counts as a word: the character where it stands in the text, and its sounds."""

    character: int
    sounds: list[Sound]


class _Id(ctypes.Union):
    _fields_ = [("number", ctypes.c_int), ("name", ctypes.c_char_p), ("string", ctypes.c_char * 8)]


class _RawEvent(ctypes.Structure):
    _fields_ = [
        ("type", ctypes.c_int),
        ("unique_identifier", ctypes.c_uint),
        ("text_position", ctypes.c_int),
        ("length", ctypes.c_int),
        ("audio_position", ctypes.c_int),
        ("sample", ctypes.c_int),
        ("user_data", ctypes.c_void_p),
        ("id", _Id),
    ]


class _RawVoice(ctypes.Structure):
    _fields_ = [("name", ctypes.c_char_p), ("languages", ctypes.c_void_p), ("identifier", ctypes.c_char_p)]


_CALLBACK = ctypes.CFUNCTYPE(
    ctypes.c_int, ctypes.POINTER(ctypes.c_short), ctypes.c_int, ctypes.POINTER(_RawEvent)
)


_LOCK = Lock()


@contextmanager
def _espeak() -> Iterator[tuple[Any, int]]:
    """The library as if just started, and its sample rate, for one thread at a time.

    It has one state for the whole process, and keeps parts of it even when it is initialised again, so that
    the same text would sound otherwise the next time. Hence it is loaded anew (5 ms).

    Raises:
        GestureBotError: It is not installed.
    """
    try:
        import espeakng_loader
    except ImportError as error:
        raise GestureBotError(
            "the voice espeak needs espeak-ng: pip install espeakng-loader (the extra `espeak`; GPL-3)"
        ) from error
    data = espeakng_loader.get_data_path()
    with _LOCK:
        library = ctypes.CDLL(espeakng_loader.get_library_path())
        try:
            options = _PHONEME_EVENTS | _IPA | _DONT_EXIT
            rate = library.espeak_Initialize(_SYNCHRONOUS, _MILLISECONDS, data.encode(), options)
            if rate <= 0:
                raise GestureBotError(f"espeak-ng cannot be started with its data in {data}")
            yield library, rate
            library.espeak_Terminate()
        finally:
            dlclose(library._handle)


@cache
def languages() -> dict[str, bytes]:
    """Each code, and the file of the voice that speaks it best."""
    found: dict[str, tuple[int, bytes]] = {}
    with _espeak() as (library, _):
        library.espeak_ListVoices.restype = ctypes.POINTER(ctypes.POINTER(_RawVoice))
        for voice in _until(library.espeak_ListVoices(None), lambda voice: not voice):
            # A priority, where less is better, and a code that ends with a zero, again and again.
            place = voice.contents.languages
            while priority := ctypes.string_at(place, 1)[0]:
                code = ctypes.string_at(place + 1)
                place += len(code) + 2
                one = priority, voice.contents.identifier
                found[code.decode()] = min(one, found.get(code.decode(), one))
    return {code: file for code, (_, file) in found.items()}


def synthesize(
    text: str, file: bytes, *, rate: float, pitch: float, pitch_range: float
) -> tuple[np.ndarray, list[Event]]:
    """Speak a text: (n,) float32 at SAMPLE_RATE, and what is said in them, in order.

    Args:
        text: It may be of any length and hold anything.
        file: A voice of `languages`.
        rate: Words per minute.
        pitch: 0 to 100; 50 is the voice's own, and 50 more are an octave.
        pitch_range: 0 to 100; 50 is the voice's own.
    """
    parts = [np.zeros(0, np.int16)]
    raw: list[tuple[int, int, int, str]] = []

    @_CALLBACK
    def collect(samples: Any, length: int, events: Any) -> int:
        if length > 0:
            parts.append(np.ctypeslib.as_array(samples, (length,)).copy())
        for event in _until(events, lambda event: event.type == 0):
            if event.type in (_WORD_EVENT, _PHONEME_EVENT):
                ipa = event.id.string.decode(errors="ignore") if event.type == _PHONEME_EVENT else ""
                raw.append((event.type, event.text_position, event.sample, ipa))
        return 0

    plain = text.replace("\0", " ").encode(errors="replace")
    with _espeak() as (library, sample_rate):
        library.espeak_SetSynthCallback(collect)
        library.espeak_SetVoiceByName(file)
        for parameter, value in ((_RATE, rate), (_PITCH, pitch), (_RANGE, pitch_range)):
            library.espeak_SetParameter(parameter, round(value), 0)
        library.espeak_Synth(plain, len(plain) + 1, 0, _CHARACTERS, 0, _UTF8, None, None)
    samples = np.concatenate(parts)
    ends = [sample for _, _, sample, _ in raw[1:]] + [len(samples)]
    said: list[Event] = []
    for (kind, position, sample, ipa), end in zip(raw, ends[: len(raw)], strict=True):
        if kind == _WORD_EVENT:
            said.append(Event(position - 1, []))
        elif said:
            said[-1].sounds.append(Sound(ipa, sample / sample_rate, end / sample_rate))
    return soxr.resample(samples.astype(np.float32) / 2**15, sample_rate, SAMPLE_RATE), said


def _until(array: Any, ended: Callable[[Any], bool]) -> Iterator[Any]:
    """The elements of a C array before the one that ends it."""
    return takewhile(lambda one: not ended(one), (array[i] for i in count()))
