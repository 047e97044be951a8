"""How English text is read: its words as written, and the phonemes of each."""

import json
import re
import unicodedata
from difflib import SequenceMatcher
from functools import cache
from pathlib import Path

from hibari import Hibari
from hibari.g2p import ASSETS, G2P
from hibari.g2p.normalize import normalize

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.speech.voice import bare

Span = tuple[int, int]
"""First index, and the one behind the last."""

_PHONES = {
    "A": "EY", "I": "AY", "W": "AW", "Y": "OY", "O": "OW", "Q": "OW", "i": "IY", "u": "UW", "ɑ": "AA",
    "ɒ": "AA", "ɔ": "AO", "æ": "AE", "a": "AE", "ɛ": "EH", "ɜ": "ER", "ɪ": "IH", "ᵻ": "IH", "ʊ": "UH",
    "ʌ": "AH", "ə": "AH", "ᵊ": "AH", "ɐ": "AH", "b": "B", "d": "D", "f": "F", "h": "HH", "j": "Y",
    "k": "K", "l": "L", "m": "M", "n": "N", "p": "P", "s": "S", "t": "T", "T": "T", "v": "V", "w": "W",
    "z": "Z", "ɡ": "G", "ŋ": "NG", "ɹ": "R", "ʃ": "SH", "ʒ": "ZH", "ʤ": "JH", "ʧ": "CH", "ð": "DH", "θ": "TH",
}  # fmt: skip
"""hibari's phoneme symbols as the phones of pocketsphinx's acoustic model, which are the CMU dictionary's."""

_WORD = re.compile(r"\w+(?:[-'’.,:/@&]\w+)*")


def written_words(text: str) -> list[tuple[str, Span]]:
    """The words of a text in any script, without the punctuation around them, and where each stands."""
    # Python's \w knows no combining marks, of which Indic vowels are some.
    letters = "".join("x" if unicodedata.category(c).startswith("M") else c for c in text)
    return [(text[slice(*found.span())], found.span()) for found in _WORD.finditer(letters)]


def sentences(text: str) -> list[str]:
    """The sentences of a text."""
    return list(Hibari.split_sentences(text))


def read(sentence: str) -> tuple[str, list[tuple[str, Span]]]:
    """The phoneme symbols of an English sentence, and its words with the symbols that each spans.

    Symbols are hibari's: IPA with one letter for each diphthong, a stress mark before a vowel, spaces and
    punctuation. Words are those as written. One that is read as several (2024) spans them all; one that
    cannot be read (other scripts) is left out.
    """
    g2p, vocabulary = _g2p()
    symbols = ""
    spoken = []
    for token in g2p.phonemize_tokens(g2p.tokenize(normalize(sentence))):
        sounds = "".join(c for c in token.phonemes or "" if c in vocabulary)
        if any(c.isalpha() for c in sounds):
            spoken.append((token.text, (len(symbols), len(symbols) + len(sounds))))
        if sounds:
            symbols += sounds + token.whitespace
    return symbols.rstrip(), _match(sentence, spoken)


@cache
def _g2p() -> tuple[G2P, frozenset[str]]:
    return G2P(), frozenset(json.loads((Path(ASSETS) / "vocab.json").read_text(encoding="utf-8")))


def _match(sentence: str, spoken: list[tuple[str, Span]]) -> list[tuple[str, Span]]:
    """The words as written with the symbols that each spans.

    Written and spoken words are aligned like two versions of a text, since numbers and abbreviations are read
    as other words. Where their counts differ, the spoken ones are dealt out evenly.
    """
    written = [word for word, _ in written_words(sentence)]
    said = [bare(text) for text, _ in spoken]
    alignment = SequenceMatcher(None, [bare(word) for word in written], said, autojunk=False)
    matched = []
    for _, first_written, last_written, first_spoken, last_spoken in alignment.get_opcodes():
        words, share = written[first_written:last_written], spoken[first_spoken:last_spoken]
        if not share:
            continue
        for i, word in enumerate(words):
            first = i * len(share) // len(words)
            last = max(first, (i + 1) * len(share) // len(words) - 1)
            matched.append((word, (share[first][1][0], share[last][1][1])))
    return matched


def pronounce(word: str) -> str:
    """How an English word is said, as phones of the CMU dictionary with single spaces, such as `R OW B AA T`.

    Raises:
        InvalidValueError: It has no letters that English is written in.
    """
    symbols, _ = read(word)
    phones, _ = phones_of(symbols)
    if not phones:
        raise InvalidValueError(
            "cannot tell how this word is said; write it with the letters of English", word
        )
    return " ".join(phones)


def phones_of(symbols: str) -> tuple[tuple[str, ...], int | None]:
    """Phoneme symbols as phones of the CMU dictionary, and which of these is the stressed vowel, if any."""
    phones: list[str] = []
    stresses: dict[str, int] = {}
    for symbol in symbols.replace("ɜɹ", "ɜ").replace("əɹ", "ɜ"):  # one phone, ER
        if symbol in _PHONES:
            phones.append(_PHONES[symbol])
        else:
            stresses.setdefault(symbol, len(phones))
    return tuple(phones), stresses.get("ˈ", stresses.get("ˌ"))
