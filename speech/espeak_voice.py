"""A voice for over a hundred languages: espeak-ng, through its C API, with the time of each word.

espeak-ng is GPL-3. It comes with the extra `espeak` (the wheel espeakng-loader) and is loaded only here.
"""

import ctypes
from _ctypes import dlclose
from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from itertools import count, takewhile
from threading import Lock
from typing import Any

import numpy as np
import soxr

from gesture_bot.base.errors import GestureBotError, InvalidValueError
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.loudness import amplified
from gesture_bot.speech.pronunciation import written_words
from gesture_bot.speech.voice import PLAIN, Manner, Utterance, Word

LEVEL = 0.45
"""Factor of its samples that makes it as loud as the embedded voice."""

WORDS_PER_MINUTE = 175
"""Its own speed."""

TONES = (0.5, 2.0)
"""Lowest and highest that espeak-ng's parameter of pitch goes, as factors."""

STIFFNESS = 1.2
"""How much further that parameter must move than the pitch is to; measured in English, German and Russian."""

# From espeak-ng's speak_lib.h.
_SYNCHRONOUS, _MILLISECONDS = 2, 200
_PHONEME_EVENTS, _IPA, _DONT_EXIT = 0x1, 0x2, 0x8000
_WORD_EVENT, _PHONEME_EVENT = 1, 7
_RATE, _PITCH, _RANGE = 1, 3, 4
_CHARACTERS, _UTF8 = 1, 1


class EspeakVoice:
    """One language of espeak-ng. The same text in the same manner gives the same samples.

    Args:
        language: A code that espeak-ng knows, such as en, de, pt-br.

    Raises:
        InvalidValueError: espeak-ng has no such language; lists those that it has.
        GestureBotError: espeak-ng is not installed.
    """

    def __init__(self, language: str = "en") -> None:
        known = _languages()
        if language not in known:
            valid = [*sorted(code for code in known if "-" not in code), "en-us and other variants"]
            raise InvalidValueError("espeak-ng has no such language", language, valid)
        self._file = known[language]

    def speak(self, text: str, manner: Manner = PLAIN) -> Utterance:
        """Speak a text of any length.

        Words are those of the text as written. One that is read as several (2024) spans them all; such as are
        read as one (I am) share its time.

        Raises:
            InvalidValueError: The text holds nothing that can be spoken.
        """
        samples, events = _synthesize(text, self._file, manner)
        words = _words(text, events)
        if not words:
            raise InvalidValueError("the text holds nothing that can be spoken", text)
        return Utterance(amplified(samples, LEVEL * manner.energy), words)


@dataclass(frozen=True)
class _Sound:
    """A phoneme, or a pause, which has no name."""

    ipa: str
    start: float
    end: float


@dataclass(frozen=True)
class _Event:
    """What espeak-ng counts as a word: the character where it stands in the text, and its sounds."""

    character: int
    sounds: list[_Sound]


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
def _languages() -> dict[str, bytes]:
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


def _synthesize(text: str, file: bytes, manner: Manner) -> tuple[np.ndarray, list[_Event]]:
    """(n,) float32 at SAMPLE_RATE, and what is said in them, in order."""
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

    tone = np.clip(1 + STIFFNESS * (manner.pitch - 1), *TONES)
    parameters = {
        _RATE: WORDS_PER_MINUTE * manner.speed,
        _PITCH: 50 + 50 * np.log2(tone),
        _RANGE: 50 * tone,
    }
    plain = text.replace("\0", " ").encode(errors="replace")
    with _espeak() as (library, rate):
        library.espeak_SetSynthCallback(collect)
        library.espeak_SetVoiceByName(file)
        for parameter, value in parameters.items():
            library.espeak_SetParameter(parameter, round(value), 0)
        library.espeak_Synth(plain, len(plain) + 1, 0, _CHARACTERS, 0, _UTF8, None, None)
    samples = np.concatenate(parts)
    ends = [sample for _, _, sample, _ in raw[1:]] + [len(samples)]
    said: list[_Event] = []
    for (kind, position, sample, ipa), end in zip(raw, ends[: len(raw)], strict=True):
        if kind == _WORD_EVENT:
            said.append(_Event(position - 1, []))
        elif said:
            said[-1].sounds.append(_Sound(ipa, sample / rate, end / rate))
    return soxr.resample(samples.astype(np.float32) / 2**15, rate, SAMPLE_RATE), said


def _until(array: Any, ended: Callable[[Any], bool]) -> Iterator[Any]:
    """The elements of a C array before the one that ends it."""
    return takewhile(lambda one: not ended(one), (array[i] for i in count()))


def _words(text: str, events: Sequence[_Event]) -> tuple[Word, ...]:
    """The words of the text as written, each with the time of what was said for it."""
    written = written_words(text)
    starts, ends = ([span[i] for _, span in written] for i in (0, 1))
    groups: list[tuple[list[int], list[_Sound]]] = []
    done = 0
    for event in events:
        # The word in which the character stands; a sign (%) belongs to the word that it touches.
        word = bisect_right(starts, event.character) - 1
        if word < 0 or event.character > ends[word]:
            touched = word + 1 < len(written) and starts[word + 1] <= event.character + 1
            word = word + 1 if touched else -1
        if word >= done:
            # Words that espeak-ng did not announce (the second of `I am`) were said with the one before.
            first = done
            if groups:
                groups[-1][0].extend(range(done, word))
                first = word
            groups.append((list(range(first, word + 1)), []))
            done = word + 1
        if word >= 0 and groups:
            groups[-1][1].extend(event.sounds)
    if groups:
        groups[-1][0].extend(range(done, len(written)))
    return tuple(word for group, sounds in groups for word in _timed([written[i][0] for i in group], sounds))


def _timed(words: Sequence[str], sounds: Sequence[_Sound]) -> list[Word]:
    """Words that share some sounds, each as long as it is written; the stressed one has the stress."""
    heard = [sound for sound in sounds if sound.ipa]
    if not heard:
        return []
    stressed = next((sound for mark in "ˈˌ" for sound in heard if mark in sound.ipa), None)
    shares = np.cumsum([0, *map(len, words)]) / sum(map(len, words))
    edges = heard[0].start + (heard[-1].end - heard[0].start) * shares
    timed = []
    for word, start, end in zip(words, map(float, edges), map(float, edges[1:]), strict=False):
        middle = (stressed.start + stressed.end) / 2 if stressed else -1.0
        timed.append(Word(word, start, end, middle if start < middle < end else (start + end) / 2))
    return timed
