"""What the recogniser of words can hear: everyday English, with the phrases that matter made likelier."""

import re
from collections.abc import Iterable, Iterator
from itertools import islice, product

import pocketsphinx

from gesture_bot.base.errors import GestureBotError
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.pronunciation import pronounce

WEIGHT = 100.0
"""How much likelier than a word drawn evenly from the language model a phrase of interest is."""

LONG = 5
"""A phrase of interest is made likelier from so many sounds on; a shorter one would be heard everywhere."""

PRONUNCIATIONS = 6
"""Ways to say a phrase that are known, at most."""

MEAN = "41.00,-5.29,-0.12,5.09,2.48,-4.07,-1.37,-1.78,-5.08,-2.05,-6.45,-1.42,1.17"
"""Cepstral mean of the speech that the acoustic model was trained on, until enough is heard here."""

JOINT = "_"
"""Joins the words of a phrase into one entry of the dictionary, and ends the second entry of a word."""


class Vocabulary:
    """A decoder, and what its entries are made of.

    The language model and the dictionary are those of pocketsphinx's wheel (US English, 135,000 words). Each
    phrase, and each long word, gets an entry of its own beside them, whose probability in the language model
    is WEIGHT times that of a word drawn evenly, whatever was said before. A phrase is then one long word.

    Args:
        phrases: Lower-case words with single spaces between them.
    """

    def __init__(self, phrases: Iterable[str]) -> None:
        # One fast pass. The flat pass and the best path change words long after they were said.
        self.decoder = pocketsphinx.Decoder(
            samprate=SAMPLE_RATE,
            loglevel="FATAL",
            fwdflat=False,
            bestpath=False,
            maxhmmpf=3000,
            maxwpf=5,
            cmninit=MEAN,
        )
        self.problems: list[str] = []
        self._phones: dict[str, int] = {}
        model = pocketsphinx.NGramModel(
            self.decoder.config, self.decoder.logmath, pocketsphinx.get_model_path("en-us/en-us.lm.bin")
        )
        phrases = sorted(set(phrases))
        unknown = set()
        for word in sorted({word for phrase in phrases for word in phrase.split()}):
            try:
                if self.decoder.lookup_word(word) is None:
                    self.decoder.add_word(word, pronounce(word), update=False)
                    model.add_word(word, WEIGHT)
            except GestureBotError as error:
                unknown.add(word)
                self.problems.append(f"no pronunciation of {word!r}, which is not heard ({error})")
        for phrase in phrases:
            words = phrase.split()
            if not unknown.intersection(words) and sum(map(self.phones, words)) >= LONG:
                entry = JOINT.join(words) if len(words) > 1 else phrase + JOINT
                for number, said in enumerate(islice(self._ways(words), PRONUNCIATIONS), 1):
                    self.decoder.add_word(entry if number == 1 else f"{entry}({number})", said, update=False)
                model.add_word(entry, WEIGHT)
        self.decoder.add_lm("phrases", model)
        self.decoder.activate_search("phrases")

    def phones(self, word: str) -> int:
        """How many sounds a word of the dictionary has."""
        if word not in self._phones:
            self._phones[word] = len((self.decoder.lookup_word(word) or "").split())
        return self._phones[word]

    def _ways(self, words: list[str]) -> Iterator[str]:
        for ways in product(*map(self._pronunciations, words)):
            yield " ".join(ways)

    def _pronunciations(self, word: str) -> list[str]:
        found = (self.decoder.lookup_word(name) for name in (word, f"{word}(2)", f"{word}(3)"))
        return [phones for phones in found if phones]


def words_of(entry: str) -> list[str]:
    """The words of an entry of the dictionary; none where it is silence or noise."""
    entry = re.sub(r"\(\d+\)$", "", entry)
    return [] if entry[0] in "<[+" else entry.strip(JOINT).split(JOINT)
