"""A voice for over a hundred languages: espeak-ng, with the time of each word."""

from bisect import bisect_right
from collections.abc import Sequence

import numpy as np

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.speech import espeak
from gesture_bot.speech.espeak import Event, Sound
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


class EspeakVoice:
    """One language of espeak-ng. The same text in the same manner gives the same samples.

    Args:
        language: A code that espeak-ng knows, such as en, de, pt-br.

    Raises:
        InvalidValueError: espeak-ng has no such language; lists those that it has.
        GestureBotError: espeak-ng is not installed.
    """

    def __init__(self, language: str = "en") -> None:
        known = espeak.languages()
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
        tone = np.clip(1 + STIFFNESS * (manner.pitch - 1), *TONES)
        samples, events = espeak.synthesize(
            text,
            self._file,
            rate=WORDS_PER_MINUTE * manner.speed,
            pitch=50 + 50 * np.log2(tone),
            pitch_range=50 * tone,
        )
        words = _words(text, events)
        if not words:
            raise InvalidValueError("the text holds nothing that can be spoken", text)
        return Utterance(amplified(samples, LEVEL * manner.energy), words)


def _words(text: str, events: Sequence[Event]) -> tuple[Word, ...]:
    """The words of the text as written, each with the time of what was said for it."""
    written = written_words(text)
    starts, ends = ([span[i] for _, span in written] for i in (0, 1))
    groups: list[tuple[list[int], list[Sound]]] = []
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


def _timed(words: Sequence[str], sounds: Sequence[Sound]) -> list[Word]:
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
