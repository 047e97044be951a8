"""What is said when: utterances wait for each other, come out ahead of their sound, and are cut short."""

from collections import deque
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from gesture_bot.base.frames import first_frame_after, frame_time
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.voice import Utterance

PIECE = SAMPLE_RATE // 10
"""Samples that are given out at once: 100 ms."""

QUIET = 0.1
"""After a cut, nothing is given out for so long, so that it overtakes the cut nowhere [s]."""


@dataclass(eq=False)
class Spoken:
    """An utterance and its place in time.

    Attributes:
        utterance: What is said.
        start: When its first sample is heard, on the frame grid [s since the epoch].
    """

    utterance: Utterance
    start: float

    @property
    def end(self) -> float:
        """When its last sample has been heard [s since the epoch]."""
        return self.start + len(self.utterance.samples) / SAMPLE_RATE


@dataclass(frozen=True)
class Piece:
    """Samples to give out.

    Attributes:
        number: Counts up with every utterance that begins.
        moment: When the first sample is heard [s since the epoch].
        samples: (n,) float32 at SAMPLE_RATE.
        last: Whether the utterance ends with them.
    """

    number: int
    moment: float
    samples: np.ndarray
    last: bool


class Speaking:
    """Utterances in the order in which they are heard.

    Args:
        lead: Sound is given out so long before it is heard, at most [s].
        start_delay: From being put into the queue to being heard, at least [s].
    """

    def __init__(self, lead: float, start_delay: float) -> None:
        self._lead, self._start_delay = lead, start_delay
        self._queue: deque[Spoken] = deque()
        self._waiting: deque[Spoken | Piece] = deque()
        self._number = 0
        self._silent_until = 0.0
        self.end = 0.0

    def put(self, utterance: Utterance, now: float) -> Spoken:
        """Say an utterance after all others [s since the epoch]."""
        spoken = Spoken(utterance, 0.0)
        self._place(spoken, now)
        return spoken

    def due(self, now: float) -> list[Spoken | Piece]:
        """What is to be given out now: an utterance, for its words, before its pieces."""
        due = []
        while self._waiting and now >= self._silent_until:
            if _moment(self._waiting[0]) - self._lead > now:
                break
            due.append(self._waiting.popleft())
        while self._queue and self._queue[0].end < now:
            self._queue.popleft()
        return due

    def cut(self, unwanted: Collection[Spoken], now: float) -> float | None:
        """Take back some utterances, wherever they are; those behind them move up.

        Returns:
            The moment from which on all that was given out is void; None where nothing has to be taken back.
        """
        cut = next((spoken for spoken in self._queue if spoken in unwanted and spoken.end > now), None)
        if cut is None:
            return None
        moment = max(now, cut.start)
        before = [spoken for spoken in self._queue if spoken.start < cut.start]
        behind = [spoken for spoken in self._queue if spoken.start > cut.start and spoken not in unwanted]
        first = [one for one in self._waiting if _moment(one) < cut.start]
        self._queue, self._waiting, self.end = deque(before), deque(first), moment
        self._silent_until = now + QUIET
        for spoken in behind:
            self._place(spoken, now)
        return moment

    def _place(self, spoken: Spoken, now: float) -> None:
        spoken.start = frame_time(first_frame_after(max(now + self._start_delay, self.end)))
        self.end = spoken.end
        self._number += 1
        self._queue.append(spoken)
        self._waiting.append(spoken)
        samples = spoken.utterance.samples
        for first in range(0, len(samples), PIECE):
            last = first + PIECE >= len(samples)
            moment = spoken.start + first / SAMPLE_RATE
            self._waiting.append(Piece(self._number, moment, samples[first : first + PIECE], last))


def _moment(waiting: Spoken | Piece) -> float:
    return waiting.start if isinstance(waiting, Spoken) else waiting.moment
