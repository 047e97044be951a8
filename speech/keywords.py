"""Keywords in spoken words: which semantic gesture, and when its stroke is due."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.speech.voice import Word, bare

PAUSE = 0.4
"""Words further apart than this belong to no phrase: one sentence has ended, and another begins [s]."""


@dataclass(frozen=True)
class Spotted:
    """A trigger phrase that was heard.

    Attributes:
        gesture: The gesture that it triggers.
        phrase: The phrase as the triggers write it.
        start: When it begins [s], on the clock of its words.
        end: When it ends [s].
        stress: The middle of the first word's stressed vowel [s]: a stroke does not come after its words.
    """

    gesture: str
    phrase: str
    start: float
    end: float
    stress: float


class KeywordSpotter:
    """Finds trigger phrases in words that arrive one by one or many at a time.

    Case and punctuation do not matter. The longest phrase wins, and no word belongs to two phrases. A phrase
    has no pause in it.

    Args:
        triggers: Word or phrase -> name of its gesture.

    Raises:
        InvalidValueError: A trigger holds no word.
    """

    def __init__(self, triggers: Mapping[str, str]):
        self._words: list[Word] = []
        self.set_triggers(triggers)

    def set_triggers(self, triggers: Mapping[str, str]) -> None:
        """Find other phrases from now on, also in the words that wait.

        Raises:
            InvalidValueError: A trigger holds no word; the others stay.
        """
        phrases = {tuple(filter(None, map(bare, phrase.split()))): phrase for phrase in triggers}
        if () in phrases:
            raise InvalidValueError("a trigger holds no word", phrases[()])
        self._phrases, self._triggers = phrases, dict(triggers)

    def spot(self, words: Iterable[Word]) -> list[Spotted]:
        """Take in the next words; words that may yet become a longer phrase wait for the next call."""
        self._words += [word for word in words if bare(word.text)]
        return self._spot(more=True)

    def cut(self, moment: float) -> None:
        """The words that wait and begin from a moment on will not be heard."""
        self._words = [word for word in self._words if word.start < moment]

    def flush(self) -> list[Spotted]:
        """Nothing follows the words so far: decide those that wait."""
        return self._spot(more=False)

    def _spot(self, more: bool) -> list[Spotted]:
        found = []
        while self._words:
            heard = tuple(bare(word.text) for word in self._spoken_together())
            waits = more and len(heard) == len(self._words)
            if waits and any(
                len(keys) > len(heard) and keys[: len(heard)] == heard for keys in self._phrases
            ):
                break
            length = max((len(keys) for keys in self._phrases if heard[: len(keys)] == keys), default=0)
            if length:
                phrase, spoken = self._phrases[heard[:length]], self._words[:length]
                gesture = self._triggers[phrase]
                found.append(Spotted(gesture, phrase, spoken[0].start, spoken[-1].end, spoken[0].stress))
            del self._words[: max(length, 1)]
        return found

    def _spoken_together(self) -> list[Word]:
        """The words up to the first pause between two."""
        for count, (word, following) in enumerate(pairwise(self._words), 1):
            if following.start - word.end > PAUSE:
                return self._words[:count]
        return self._words
