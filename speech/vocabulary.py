"""Trigger words that no dictionary has: heard by how they sound."""

from collections.abc import Iterable, Sequence
from difflib import SequenceMatcher
from functools import lru_cache
from pathlib import Path

from pocketsphinx import get_model_path

from gesture_bot.base.errors import GestureBotError
from gesture_bot.speech.pronunciation import pronounce
from gesture_bot.speech.transcriber import Transcribed

UNSURE = 0.7
"""Only words that the transcriber gives less probability may be a rare word that it does not know."""

ALIKE = 0.7
"""So large a share of their sounds two words must share, in order, to be the same."""

LONGEST = 3
"""A rare word may be heard as so many others at most."""

_ALIKE = ("P B", "T D", "K G", "F V", "S Z SH ZH", "CH JH", "TH DH", "N NG")
"""Consonants that a transcriber takes for one another; all vowels are one sound here."""

_SOUND = {phone: phones.split()[0] for phones in _ALIKE for phone in phones.split()}


class Vocabulary:
    """What phrases of interest add to the words that a transcriber knows.

    Args:
        phrases: Lower-case words with single spaces between them.

    Attributes:
        problems: Words that cannot be heard, and why.
    """

    def __init__(self, phrases: Iterable[str]) -> None:
        self.problems: list[str] = []
        self._rare: dict[str, tuple[str, ...]] = {}
        dictionary = Path(get_model_path("en-us/cmudict-en-us.dict")).read_text()
        known = {line.split(" ", 1)[0] for line in dictionary.splitlines()}
        for word in sorted({word for phrase in phrases for word in phrase.split()}):
            try:
                if word not in known:
                    self._rare[word] = _sounds(word)
            except GestureBotError as error:
                self.problems.append(f"no pronunciation of {word!r}, which is not heard ({error})")

    def spell(self, words: Sequence[Transcribed]) -> list[Transcribed]:
        """The same words, but a rare one in place of what sounds like it."""
        spelt: list[Transcribed] = []
        at = 0
        while at < len(words):
            alike, word, count = max(
                (
                    (self._likeness(words[at : at + count], rare), rare, count)
                    for rare in self._rare
                    for count in range(1, min(LONGEST, len(words) - at) + 1)
                ),
                default=(0.0, "", 1),
            )
            found = alike >= ALIKE
            spelt.append(Transcribed(word, alike) if found else words[at])
            at += count if found else 1
        return spelt

    def _likeness(self, words: Sequence[Transcribed], rare: str) -> float:
        if any(word.confidence >= UNSURE for word in words):
            return 0.0
        try:
            heard = [sound for word in words for sound in _sounds(word.text)]
        except GestureBotError:
            return 0.0
        return SequenceMatcher(None, heard, self._rare[rare], autojunk=False).ratio()


@lru_cache(maxsize=4096)
def _sounds(word: str) -> tuple[str, ...]:
    phones = pronounce(word).split()
    return tuple("A" if phone[0] in "AEIOU" else _SOUND.get(phone, phone) for phone in phones)
