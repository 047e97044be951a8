"""Words in sound, as soon as they are sure enough: streaming recognition with pocketsphinx."""

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import pocketsphinx

from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.vocabulary import Vocabulary, words_of

LOOK = 2
"""The decoder is asked what it has heard after so many frames of voice activity, 60 ms."""

ACTIVE = 5
"""Voice begins when so many of the last 2 * ACTIVE frames of voice activity have it."""

PRE_ROLL = 0.4
"""Sound from before voice was noticed that the decoder hears, too [s]."""

PAUSE = 0.45
"""So long without voice ends an utterance of the decoder, and decides all of its words [s]."""

TAIL = 0.3
"""Silence that is added where the sound ends [s]."""

LONGEST = 20.0
"""An utterance of the decoder ends after so long at the latest [s]."""

JUMP = 0.09
"""Sound that comes so much earlier or later than it should does not go on from the last [s].

Less than a lost piece of 100 ms, and more than the moments of a microphone waver.
"""

CONFIDENCE = np.array([2.3, 0.0087, 0.0053, 0.48])
"""Weights of the confidence: fitted to 1,362 words of the demo corpus' sentences by two synthetic voices."""

LOG_BASE = 1e-4
"""Natural logarithm of the base in which pocketsphinx counts scores."""

_FRAME = 0.01
"""A frame of the decoder [s]."""

SAME = 0.06
"""A word is still the same in the next hypothesis where its begin has moved less [s]."""

LONGER = 0.1
"""A word that was decided was only the beginning of one that is so much longer [s]: danger, dangerous."""

SHORT, MIDDLE, LONG, PHRASE = (0.24, 0.18), (0.18, 0.12), (0.12, 0.12), (0.06, 0.12)
"""When words of up to 3, of 4 or 5, and of more sounds, and those of a phrase of interest, are sure enough.

After so long in the best hypothesis, and so long after their end [s]: the fewer the sounds, the more other
words begin like them.
"""


@dataclass(frozen=True)
class RecognisedWord:
    """A word that was heard.

    Attributes:
        text: In lower case.
        start: When it begins, on the clock of the sound [s].
        end: When it ends [s].
        confidence: Estimated probability that it was said.
    """

    text: str
    start: float
    end: float
    confidence: float


NOTHING = RecognisedWord("", -np.inf, -np.inf, 0.0)


@dataclass(frozen=True)
class _Hypothesis:
    word: RecognisedWord
    needs: tuple[float, float]
    since: float = 0.0


class Recogniser:
    """Hears words in a stream of samples.

    Voice activity begins and ends utterances of the decoder, so silence costs little. A word is given out, in
    the order of speech and once, when it has stayed in the best hypothesis for a time that depends on how
    much evidence there is. What the decoder thinks later of its place is not told, but for a longer word that
    begins like it.

    Args:
        phrases: Phrases that matter; see Vocabulary.
    """

    def __init__(self, phrases: Iterable[str]) -> None:
        self._vocabulary = Vocabulary(phrases)
        self._decoder = self._vocabulary.decoder
        self._voice = pocketsphinx.Vad(mode=2, sample_rate=SAMPLE_RATE, frame_length=0.03)
        self._frame = self._voice.frame_bytes // 2
        self._waiting = np.zeros(0, np.int16)
        self._lead: deque[bytes] = deque(maxlen=round(PRE_ROLL / self._voice.frame_length))
        self._active: deque[bool] = deque(maxlen=2 * ACTIVE)
        self._now = 0.0
        self._begin: float | None = None
        self._quiet = self._frames = 0
        self._hypotheses: list[_Hypothesis] = []
        self._last = NOTHING

    @property
    def problems(self) -> list[str]:
        """Words of the phrases that cannot be heard, and why."""
        return self._vocabulary.problems

    def push(self, samples: np.ndarray, moment: float) -> list[RecognisedWord]:
        """Take in the next sound; where it does not go on from the last, that has ended.

        Args:
            samples: (n,) float32, mono, at SAMPLE_RATE, full scale 1; any number.
            moment: Of the first one [s].

        Returns:
            Words that are sure by now, in the order of speech.
        """
        words = []
        expected = self._now + len(self._waiting) / SAMPLE_RATE
        if abs(moment - expected) > JUMP:
            words += self.flush()
        if self._begin is None:
            self._now = moment - len(self._waiting) / SAMPLE_RATE
        pcm = (np.clip(samples, -1, 1) * 32767).astype(np.int16)
        self._waiting = np.concatenate([self._waiting, pcm])
        while len(self._waiting) >= self._frame:
            frame, self._waiting = self._waiting[: self._frame], self._waiting[self._frame :]
            words += self._hear(frame.tobytes())
        return words

    def flush(self) -> list[RecognisedWord]:
        """Nothing follows the sound so far: decide all of its words."""
        words = []
        if self._begin is not None:
            # Without silence behind it, the last word is taken for one that goes on.
            self._decoder.process_raw(self._waiting.tobytes() + bytes(2 * round(TAIL * SAMPLE_RATE)))
            words = self._end()
        self._waiting = self._waiting[:0]
        self._lead.clear()
        self._active.clear()
        return words

    def _hear(self, frame: bytes) -> list[RecognisedWord]:
        active = self._voice.is_speech(frame)
        self._active.append(active)
        self._now += self._voice.frame_length
        if self._begin is None:
            self._lead.append(frame)
            if sum(self._active) >= ACTIVE:
                self._start()
            return []
        self._decoder.process_raw(frame)
        self._frames += 1
        self._quiet = 0 if active else self._quiet + 1
        if self._quiet * self._voice.frame_length >= PAUSE or self._now - self._begin > LONGEST:
            return self._end()
        return self._sure() if self._frames % LOOK == 0 else []

    def _start(self) -> None:
        sound = b"".join(self._lead)
        self._begin = self._now - len(self._lead) * self._voice.frame_length
        self._last = replace(NOTHING, end=self._begin)
        self._quiet = self._frames = 0
        self._hypotheses = []
        self._decoder.start_utt()
        self._decoder.process_raw(sound)

    def _end(self) -> list[RecognisedWord]:
        self._decoder.end_utt()
        words = [found.word for found in self._heard() if self._is_new(found.word)]
        self._begin = None
        self._lead.clear()
        self._active.clear()
        return words

    def _is_new(self, word: RecognisedWord) -> bool:
        """Whether a word comes after the last one decided, or goes on where that was only its beginning."""
        last = self._last
        longer = word.text != last.text and word.end > last.end + LONGER
        return (longer and abs(word.start - last.start) < SAME) or word.start + word.end >= 2 * last.end

    def _sure(self) -> list[RecognisedWord]:
        """Words from the last decided one on, up to the first that is not sure."""
        self._hypotheses = [self._known(found) for found in self._heard()]
        words = []
        for found in self._hypotheses:
            word = found.word
            if not self._is_new(word):
                continue
            stable, after = found.needs
            if self._now - found.since < stable - _FRAME or self._now - word.end < after - _FRAME:
                break
            words.append(word)
            self._last = word
        return words

    def _known(self, found: _Hypothesis) -> _Hypothesis:
        """The same with the moment since which it has been in the best hypothesis."""
        word = found.word
        same = (
            before.since
            for before in self._hypotheses
            if before.word.text == word.text and abs(before.word.start - word.start) < SAME
        )
        return replace(found, since=next(same, self._now))

    def _heard(self) -> Iterator[_Hypothesis]:
        """The words of the best hypothesis."""
        begin = self._begin or 0.0
        for segment in self._decoder.seg() or ():
            texts = words_of(segment.word)
            sounds = np.array([max(1, self._vocabulary.phones(text)) for text in texts])
            start, end = begin + segment.start_frame * _FRAME, begin + (segment.end_frame + 1) * _FRAME
            # Within a phrase, a word is as long as its number of sounds says.
            edges = start + (end - start) * np.concatenate([[0], np.cumsum(sounds) / max(1, sounds.sum())])
            confidence = _confidence(segment, int(sounds.sum()))
            for i, text in enumerate(texts):
                needs = PHRASE if len(texts) > 1 else _needs(int(sounds[i]))
                word = RecognisedWord(text, float(edges[i]), float(edges[i + 1]), confidence)
                yield _Hypothesis(word, needs)


def _needs(sounds: int) -> tuple[float, float]:
    return SHORT if sounds <= 3 else MIDDLE if sounds <= 5 else LONG


def _confidence(segment: pocketsphinx.Segment, sounds: int) -> float:
    """A logistic regression on acoustic score a frame, score of the language model, and number of sounds."""
    frames = segment.end_frame - segment.start_frame + 1
    acoustic, language = np.log([segment.ascore, segment.lscore]) / LOG_BASE
    return float(1 / (1 + np.exp(-CONFIDENCE @ [1.0, acoustic / frames, language, sounds])))
