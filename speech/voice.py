"""What a voice is: text in, samples and word times out."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from gesture_bot.base.errors import InvalidValueError


@dataclass(frozen=True)
class Word:
    """A spoken word.

    Attributes:
        text: The word as written, without the punctuation around it.
        start: When it begins [s from the start of the utterance].
        end: When it ends [s].
        stress: The middle of its stressed vowel [s], where a stroke lands.
    """

    text: str
    start: float
    end: float
    stress: float


@dataclass(frozen=True)
class Utterance:
    """Spoken text.

    Attributes:
        samples: (n,) float32 in [-1, 1], mono, at audio.SAMPLE_RATE.
        words: Its words in spoken order.
    """

    samples: np.ndarray
    words: tuple[Word, ...]


class Voice(Protocol):
    """Anything that speaks a text."""

    def speak(self, text: str, speed: float = 1.0) -> Utterance:
        """Speak a text; a speed of 2 takes about half the time.

        Raises:
            InvalidValueError: The text holds nothing to speak, or the speed is out of range.
        """
        ...


def bare(word: str) -> str:
    """A word as it is compared: its letters and digits, case folded."""
    return "".join(filter(str.isalnum, word)).casefold()


def _embedded() -> Voice:
    from gesture_bot.speech.embedded_voice import EmbeddedVoice

    return EmbeddedVoice()


VOICES: dict[str, Callable[[], Voice]] = {"embedded": _embedded}
"""How to load each voice; loading imports what that voice needs."""


def load_voice(name: str) -> Voice:
    """Load a voice by name.

    Raises:
        InvalidValueError: There is no such voice.
    """
    if name not in VOICES:
        raise InvalidValueError("unknown voice", name, VOICES)
    return VOICES[name]()
