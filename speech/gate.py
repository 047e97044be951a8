"""What a robot's microphone hears of the robot itself: its voice and its servos are kept out."""

from collections import deque

import numpy as np

from gesture_bot.speech.loudness import decibels

ECHO = 0.3
"""A room still echoes so long after the robot's voice [s]."""

AFTER_MOTION = 0.2
"""Servos are still heard so long after they were told to stand [s]."""

OVER_NOISE = 9.0
"""While the arms move, sound so far over the servos' noise is somebody's voice [dB]."""

SLOWEST = 0.1
"""The noise of servos grows with their speed; slower ones count as if they had this one [rad/s]."""

HANG = 0.25
"""A voice goes on so long after it was last that loud: the ends of words are soft [s]."""

_REMEMBERED = 5.0  # the noise of the servos is that of the last so many seconds with motion
_QUIET_SHARE = 25  # percentile of the levels that is noise alone, also while somebody speaks
_SILENCE = -100.0
_Span = tuple[float, float]


class MicrophoneGate:
    """Lets through what others say.

    While the robot's own voice is heard, nothing passes. While its arms move, what is not clearly louder than
    they have been lately at such a speed is taken to be their noise; its amplitude is in proportion to it.
    """

    def __init__(self) -> None:
        self._voice: list[_Span] = []
        self._motion: deque[tuple[float, float, float]] = deque(maxlen=25)
        self._levels: deque[tuple[float, float]] = deque()
        self._voice_until = -np.inf

    def speaks(self, begin: float, end: float) -> None:
        """The robot's voice is heard from one moment to another [s since the epoch]."""
        self._voice = _with(self._voice, begin, end)

    def silent_from(self, moment: float) -> None:
        """Of what the robot was to say, nothing is heard from a moment on [s since the epoch]."""
        self._voice = [(begin, min(end, moment)) for begin, end in self._voice if begin < moment]

    def moves(self, begin: float, end: float, speed: float) -> None:
        """The fastest joint has a speed [rad/s] from one moment to another [s since the epoch].

        What is told last holds.
        """
        self._motion.append((begin, end, speed))

    def passed(self, moment: float, rate: int, samples: np.ndarray) -> np.ndarray:
        """What passes of the next block of sound, some 10 to 50 ms long.

        Args:
            moment: When its first sample was recorded [s since the epoch].
            rate: Samples a second.
            samples: (n,) one channel.

        Returns:
            (n,) the block, or silence.
        """
        end = moment + len(samples) / rate
        if any(begin < end and moment < last + ECHO for begin, last in self._voice):
            return np.zeros_like(samples)
        speed = self._speed(moment, end)
        if speed:
            level = float(decibels(np.mean(np.square(samples, dtype=np.float64)), _SILENCE))
            level -= 20 * np.log10(max(speed, SLOWEST))
            self._levels.append((moment, level))
            while self._levels[0][0] < self._levels[-1][0] - _REMEMBERED:
                self._levels.popleft()
            noise = np.percentile([level for _, level in self._levels], _QUIET_SHARE)
            if level > noise + OVER_NOISE:
                self._voice_until = end + HANG
            if moment >= self._voice_until:
                return np.zeros_like(samples)
        return samples

    def _speed(self, begin: float, end: float) -> float:
        """Of the servos that are heard from one moment to another [rad/s]; 0 when none is."""
        told = [
            speed for first, last, speed in self._motion.copy() if first < end and begin < last + AFTER_MOTION
        ]
        return told[-1] if told else 0.0


def _with(spans: list[_Span], begin: float, end: float) -> list[_Span]:
    """Spans of time with one more that begins no earlier than they do; those long over are left out.

    A new list, since sound comes in another thread.
    """
    kept = [span for span in spans if span[1] > begin - 60.0]
    if kept and begin <= kept[-1][1] + 1e-3:
        begin, end = kept[-1][0], max(end, kept.pop()[1])
    return [*kept, (begin, end)]
