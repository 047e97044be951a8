"""What a voice is: text in, samples and word times out."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from gesture_bot.base.errors import InvalidValueError

MANNERS = {"speed": (0.5, 2.0), "pitch": (0.5, 2.0), "energy": (0.25, 2.0)}
"""The least and the most of what a Manner holds."""


@dataclass(frozen=True)
class Manner:
    """How a text is spoken, relative to how the voice speaks by itself.

    Attributes:
        speed: 2 takes about half the time.
        pitch: Factor of the fundamental frequency; 2 is an octave higher.
        energy: Factor of the amplitude (RMS); 2 is 6 dB louder.

    Raises:
        InvalidValueError: One of them is out of range.
    """

    # In config/emotions.yaml an unknown key is a mistake.
    __pydantic_config__ = {"extra": "forbid"}

    speed: float = 1.0
    pitch: float = 1.0
    energy: float = 1.0

    def __post_init__(self) -> None:
        for name, (least, most) in MANNERS.items():
            if not least <= getattr(self, name) <= most:
                raise InvalidValueError(
                    f"{name} of a voice is out of range", getattr(self, name), [f"{least} to {most}"]
                )

    def times(self, other: "Manner") -> "Manner":
        """Both together, at most as far as the ranges go."""
        both = {
            name: min(max(getattr(self, name) * getattr(other, name), least), most)
            for name, (least, most) in MANNERS.items()
        }
        return Manner(**both)


PLAIN = Manner()
"""As the voice speaks by itself."""


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
    """Anything that speaks a text.

    One that does not know when it says which word takes the words from alignment.align.
    """

    def speak(self, text: str, manner: Manner = PLAIN) -> Utterance:
        """Speak a text.

        Raises:
            InvalidValueError: The text holds nothing to speak.
        """
        ...


def bare(word: str) -> str:
    """A word as it is compared: its letters and digits, case folded."""
    return "".join(filter(str.isalnum, word)).casefold()


VOICES = ("embedded", "espeak", "espeak:LANGUAGE")
"""Names of voices; espeak alone speaks English."""


def load_voice(name: str) -> Voice:
    """Load a voice by name; loading imports what that voice needs.

    Raises:
        InvalidValueError: There is no such voice or language.
        GestureBotError: The voice needs an extra that is not installed.
    """
    match name.split(":"):
        case ["embedded"]:
            from gesture_bot.speech.embedded_voice import EmbeddedVoice

            return EmbeddedVoice()
        case ["espeak", *language] if len(language) < 2:
            from gesture_bot.speech.espeak_voice import EspeakVoice

            return EspeakVoice(*language)
    raise InvalidValueError("unknown voice", name, VOICES)
