"""Forced alignment: when each word of an English text is heard in its sound."""

import logging
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pocketsphinx import Decoder

from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.pronunciation import phones_of, read, sentences
from gesture_bot.speech.voice import Word

VOWEL = 1.5
"""How much longer than a consonant a vowel is taken to last."""

BEAM = 1e-200
"""How unlikely a path may become against the best one and still be followed.

With pocketsphinx's own 1e-48 it loses the end of a third of the sentences of a voice that it finds odd.
"""

SHORTEST = 0.045
"""Nobody's phones are shorter, on average over some words [s]."""

_FRAME = 0.01  # of pocketsphinx [s]


@dataclass(frozen=True)
class _Spelt:
    """A written word, its phones, and which of them is the stressed vowel, if any."""

    text: str
    phones: tuple[str, ...]
    stressed: int | None


def align(samples: np.ndarray, text: str) -> tuple[Word, ...]:
    """Find the words of an English text in its sound.

    The likeliest way to speak the words in their order is searched, with a pause between any two or without.
    A word has the phonemes that pronunciation.read gives it, so none is unknown; words of other scripts are
    left out. Inside its word the stressed vowel is placed by counting phonemes. Sound that cannot be the text
    has the words evenly spread over it.

    Args:
        samples: (n,) mono at SAMPLE_RATE.
        text: What is said in them.
    """
    words = _spelt(text)
    if (spans := _search(samples, words)) is None:
        logging.getLogger(__name__).warning(f"the sound does not fit its text: {text:.60}")
        edges = np.linspace(0, len(samples) / SAMPLE_RATE, len(words) + 1)
        spans = list(zip(edges[:-1], edges[1:], strict=True))
    return _timed(words, spans)


def fit(samples: np.ndarray, text: str) -> tuple[Word, ...] | None:
    """The same; None where the sound cannot be the text, or nobody could say it so fast."""
    words = _spelt(text)
    phones = sum(len(word.phones) for word in words)
    spans = _search(samples, words)
    if not spans or spans[-1][1] - spans[0][0] < phones * SHORTEST:
        return None
    return _timed(words, spans)


def _spelt(text: str) -> list[_Spelt]:
    return [
        spelt
        for symbols, spoken in map(read, sentences(text))
        for word, (first, last) in spoken
        if (spelt := _Spelt(word, *phones_of(symbols[first:last]))).phones
    ]


def _search(samples: np.ndarray, words: Sequence[_Spelt]) -> list[tuple[float, float]] | None:
    """When each word begins and ends [s]; None where the end of the text is not reached."""
    if not words:
        return []
    if not len(samples):
        return None
    # A new decoder each time, since one adapts to what it hears. Its lattice (bestpath) loses last words.
    beams = {"beam": BEAM, "pbeam": BEAM, "wbeam": BEAM}
    decoder = Decoder(lm=None, dict=None, bestpath=False, loglevel="FATAL", **beams)
    names = ["_".join(word.phones) for word in words]
    for name, word in dict(zip(names, words, strict=True)).items():
        decoder.add_word(name, " ".join(word.phones), False)
    decoder.set_align_text(" ".join(names))
    decoder.start_utt()
    decoder.process_raw(np.int16(np.clip(samples, -1, 1) * (2**15 - 1)).tobytes(), full_utt=True)
    decoder.end_utt()
    found = [one for one in decoder.seg() or () if not one.word.startswith(("<", "["))]
    if len(found) < len(words):
        return None
    return [(one.start_frame * _FRAME, (one.end_frame + 1) * _FRAME) for one in found]


def _timed(words: Sequence[_Spelt], spans: Sequence[tuple[float, float]]) -> tuple[Word, ...]:
    """The words with their times, the phones in each as long as they are on average."""
    timed = []
    for word, (start, end) in zip(words, spans, strict=True):
        lengths = [VOWEL if phone[0] in "AEIOU" else 1.0 for phone in word.phones]
        edges = start + (end - start) * np.cumsum([0.0, *lengths]) / sum(lengths)
        stress = edges[[0, -1]] if word.stressed is None else edges[[word.stressed, word.stressed + 1]]
        timed.append(Word(word.text, float(start), float(end), float(stress.mean())))
    return tuple(timed)
