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

AT_ONCE = 4
"""So much is given out at once: analysing it must not keep the robot's other work waiting."""


@dataclass(eq=False)
class Spoken:
    """An utterance and its place in time.

    Attributes:
        utterance: What is said.
        start: When its first sample is heard, on the frame grid [s since the epoch].
        number: As in its pieces.
    """

    utterance: Utterance
    start: float = 0.0
    number: int = 0

    @property
    def end(self) -> float:
        """When its last sample has been heard [s since the epoch]."""
        return self.start + len(self.utterance.samples) / SAMPLE_RATE


@dataclass(frozen=True)
class Piece:
    """Samples to give out.

    Attributes:
        number: Of the utterance; it counts up, also where one is put to another place.
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
        self.end = 0.0

    def put(self, utterance: Utterance, now: float) -> Spoken:
        """Say an utterance after all others [s since the epoch]."""
        spoken = Spoken(utterance)
        self._place(spoken, now)
        return spoken

    def due(self, now: float) -> list[Spoken | Piece]:
        """What is to be given out now: an utterance, for its words, before its pieces.

        No more than AT_ONCE: call it often.
        """
        due: list[Spoken | Piece] = []
        while self._waiting and _moment(self._waiting[0]) - self._lead <= now and len(due) < AT_ONCE:
            due.append(self._waiting.popleft())
        while self._queue and self._queue[0].end < now:
            self._queue.popleft()
        return due

    def cut(self, unwanted: Collection[Spoken], now: float) -> tuple[float, int] | None:
        """Take back some utterances, wherever they are; those behind them move up.

        Returns:
            The moment from which on what was given out is void, and the last number of it; None where nothing
            that is to be heard has been given out.
        """
        queue = list(self._queue)
        first = next((i for i, one in enumerate(queue) if one in unwanted and one.end > now), None)
        if first is None:
            return None
        cut, moment, number = queue[first], max(now, queue[first].start), self._number
        given_out = cut not in self._waiting
        before = [one for one in self._waiting if _moment(one) < cut.start]
        self._queue, self._waiting, self.end = deque(queue[:first]), deque(before), moment
        for spoken in queue[first + 1 :]:
            if spoken not in unwanted:
                self._place(spoken, now)
        return (moment, number) if given_out else None

    def _place(self, spoken: Spoken, now: float) -> None:
        spoken.start = frame_time(first_frame_after(max(now + self._start_delay, self.end)))
        self.end = spoken.end
        self._number += 1
        spoken.number = self._number
        self._queue.append(spoken)
        self._waiting.append(spoken)
        samples = spoken.utterance.samples
        for first in range(0, len(samples), PIECE):
            last = first + PIECE >= len(samples)
            moment = spoken.start + first / SAMPLE_RATE
            self._waiting.append(Piece(self._number, moment, samples[first : first + PIECE], last))


def _moment(waiting: Spoken | Piece) -> float:
    return waiting.start if isinstance(waiting, Spoken) else waiting.moment
