"""Words in sound, as soon as they are sure enough: streaming recognition."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import takewhile

import numpy as np

from gesture_bot.speech.activity import ActivityStream
from gesture_bot.speech.alignment import align, fit
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.transcriber import Transcribed, Transcriber
from gesture_bot.speech.vocabulary import Vocabulary

STEP = 0.2
"""An utterance is transcribed again when so much sound has been added [s]."""

PRE_ROLL = 0.5
"""Sound from before speech was noticed that belongs to an utterance, too [s]."""

PAUSE = 3
"""So many frames without speech end an utterance, and decide all of its words."""

LONGEST = 8.0
"""When an utterance lasts longer, it goes on from its last decided word [s]."""

JUMP = 0.09
"""Sound that comes so much earlier or later than it should does not go on from the last [s].

Less than a lost piece of 100 ms, and more than the moments of a microphone waver.
"""

FASTEST = 10
"""Nobody says more words a second."""

LIKELY = 0.3
"""Words with less confidence are not given out."""

SAME = 0.3
"""A word that begins so close to the same one is that one [s]."""

PIECE = SAMPLE_RATE // 10
"""Sound is looked at in pieces of so many samples: 100 ms."""


@dataclass(frozen=True)
class RecognisedWord:
    """A word that was heard.

    Attributes:
        text: In lower case.
        start: When it begins, on the clock of the sound [s].
        end: When it ends [s].
        stress: The middle of its stressed vowel [s].
        confidence: Estimated probability that it was said.
    """

    text: str
    start: float
    end: float
    stress: float
    confidence: float


class Recogniser:
    """Hears words in a stream of samples.

    Speech activity begins and ends utterances, so silence costs little. An utterance is transcribed from its
    begin again and again while it grows. A word is given out when two transcripts on end have it and the same
    words before it (local agreement: Liu and others 2020, arXiv:2005.11185). Where later ones
    have other words in its place, these are given out, too. Its times are those of a forced alignment.

    Args:
        phrases: Phrases that matter; their words are heard even if no dictionary has them.
    """

    def __init__(self, phrases: Iterable[str]) -> None:
        self._transcriber = Transcriber()
        self._vocabulary = Vocabulary(phrases)
        self._activity = ActivityStream()
        self._now = 0.0
        self._rest()

    def _rest(self) -> None:
        """Wait for the next utterance."""
        self._sound = np.zeros(0, np.float32)
        self._speaks = False
        self._quiet = 0
        self._looked = 0
        self._transcript: list[Transcribed] = []
        self._decided: list[RecognisedWord] = []
        self._told: list[RecognisedWord] = []

    @property
    def problems(self) -> list[str]:
        """Words of the phrases that cannot be heard, and why."""
        return self._vocabulary.problems

    def push(self, samples: np.ndarray, moment: float, more: bool = False) -> list[RecognisedWord]:
        """Take in the next sound; where it does not go on from the last, that has ended.

        Args:
            samples: (n,) float32, mono, at SAMPLE_RATE, full scale 1; any number.
            moment: Of the first one [s].
            more: Whether more sound waits. An utterance that goes on is then not transcribed yet, so that who
                is late catches up.

        Returns:
            Words that are sure by now.
        """
        words = self.flush() if abs(moment - self._now) > JUMP else []
        if not self._speaks:
            self._now = moment
        for first in range(0, len(samples), PIECE):
            words += self._hear(samples[first : first + PIECE])
        if self._speaks and not more and len(self._sound) - self._looked >= round(STEP * SAMPLE_RATE):
            words += self._look()
        return words

    def flush(self) -> list[RecognisedWord]:
        """Nothing follows the sound so far: decide all of its words."""
        words = self._look(last=True) if self._speaks else []
        self._activity.flush()
        self._rest()
        return words

    def _hear(self, piece: np.ndarray) -> list[RecognisedWord]:
        frames = self._activity.push(piece)
        self._now += len(piece) / SAMPLE_RATE
        self._sound = np.concatenate([self._sound, piece])
        if not self._speaks:
            self._sound = self._sound[-round(PRE_ROLL * SAMPLE_RATE) :]
            self._speaks = bool(frames.any())
            return []
        for speech in frames:
            self._quiet = 0 if speech else self._quiet + 1
        words = []
        if self._quiet >= PAUSE:
            words = self._look(last=True)
            self._rest()
        elif len(self._sound) > LONGEST * SAMPLE_RATE:
            words = self._look()
            self._go_on()
        return words

    def _go_on(self) -> None:
        """Forget what is decided; all, where nothing could be."""
        rest = self._sound[self._at(self._decided[-1].end) :] if self._decided else self._sound[:0]
        self._rest()
        self._sound, self._speaks = rest, True

    def _at(self, moment: float) -> int:
        """The sample of the utterance that is heard at a moment."""
        return max(0, len(self._sound) - round((self._now - moment) * SAMPLE_RATE))

    def _look(self, last: bool = False) -> list[RecognisedWord]:
        """Transcribe the utterance so far, and decide what is sure of it; all words, if nothing follows."""
        transcript = self._vocabulary.spell(self._transcriber.transcribe(self._sound))
        before, looked = self._transcript, self._looked
        self._transcript, self._looked = transcript, len(self._sound)
        sure = transcript if last else transcript[: _common(transcript, before)]
        kept = _common(sure, self._decided)
        if kept == len(sure):
            return []
        kept = max(0, kept - 1)  # the end of the last one is surer with what follows
        first = self._at(self._decided[kept - 1].end) if kept else 0
        begin = self._now - (len(self._sound) - first) / SAMPLE_RATE
        sound, words = self._sound[first:], transcript[kept:]
        if not last and len(transcript) - len(before) > FASTEST * (len(self._sound) - looked) / SAMPLE_RATE:
            # The end is made up. The transcript before has the sure words, too, and fits its sound better.
            sound, words = self._sound[first:looked], before[kept:]
        text = " ".join(word.text for word in words)
        if (spans := align(sound, text) if last else fit(sound, text)) is None:
            return []  # The next transcript may be better.
        self._decided[kept:] = [
            RecognisedWord(word.text, begin + at.start, begin + at.end, begin + at.stress, word.confidence)
            for word, at in zip(sure[kept:], spans, strict=False)
        ]
        new = [
            word for word in self._decided[kept:] if word.confidence >= LIKELY and not self._was_told(word)
        ]
        self._told += new
        return new

    def _was_told(self, word: RecognisedWord) -> bool:
        return any(told.text == word.text and abs(told.start - word.start) < SAME for told in self._told)


def _common(
    words: Sequence[Transcribed | RecognisedWord], others: Sequence[Transcribed | RecognisedWord]
) -> int:
    """How many words are the same before the first that differs."""
    pairs = zip(words, others, strict=False)
    return sum(1 for _ in takewhile(lambda pair: pair[0].text == pair[1].text, pairs))
