"""Beats of speech (RG22): onsets, thinned out where they are dense, and pseudo-beats in gaps."""

from collections import deque
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Self

import numpy as np
from pydantic import Field, RootModel, model_validator

from gesture_bot.base.files import config_dir, read_yaml
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.loudness import SPEECH_LEVEL, LoudnessNormaliser, decibels
from gesture_bot.speech.onsets import AVERAGED, OnsetStream
from gesture_bot.speech.windows import HOP, WINDOW_LENGTH, WindowStream

NOISE_LEVEL = SPEECH_LEVEL - 25.0
"""A window whose mean energy is over this holds speech [dB]: the signal has the loudness of speech."""

_NEVER = 2**62
_FLOOR = -100.0


@dataclass(frozen=True)
class Intervals:
    """Times from one beat to the next.

    Attributes:
        shortest: D_m of RG22 [s].
        longest: D_M of RG22, at least twice that [s].
    """

    shortest: float = 0.2
    longest: float = 0.5


class _Entry(RootModel[tuple[Annotated[float, Field(gt=0)], Annotated[float, Field(gt=0)]]]):
    @model_validator(mode="after")
    def _half(self) -> Self:
        if 2 * self.root[0] > self.root[1]:
            raise ValueError("the longest interval must be at least twice the shortest")
        return self


class _File(RootModel[dict[str, _Entry]]):
    pass


def load_intervals(language: str, path: Path | None = None) -> Intervals:
    """Intervals for a language, of a file like config/beats.yaml, which is the default.

    Args:
        language: Its code, such as `en` or `zh-TW`; one that the file lacks has those of English.
        path: The file.

    Raises:
        FileFormatError: The file does not fit; names the key and what is valid there.
    """
    entries = read_yaml(path or config_dir() / "beats.yaml", _File).root
    entry = entries.get(language) or entries.get(language.replace("_", "-").partition("-")[0].lower())
    return Intervals(*entry.root) if entry else Intervals()


def speech_beats(samples: np.ndarray, intervals: Intervals | None = None) -> np.ndarray:
    """Beats of a whole recording, (n,) [s from its start]; see BeatStream.

    Raises:
        InvalidValueError: The samples are not one channel of finite numbers.
    """
    stream = BeatStream(intervals)
    return np.concatenate([stream.push(samples), stream.flush()])


class BeatStream:
    """Beats of a signal that arrives bit by bit, the same as speech_beats of the whole.

    The first beat is the first onset. An onset closer than the shortest interval to the beat before it is
    dropped. Where none comes within the longest interval, there is a pseudo-beat: at the first window at
    least the shortest interval after the last beat and before the next onset that holds speech; in silence,
    so that pseudo-beats are as few and as even as can be told. A silence may never end; so its pseudo-beats
    have the longest interval, and only the last two share what is left.

    An onset is known at most 0.13 s after it; a pseudo-beat no later than the longest interval after that.

    Args:
        intervals: Times from one beat to the next.
        loudness: Of what the speaker said before, which goes on; otherwise the speaker is new.
    """

    def __init__(
        self, intervals: Intervals | None = None, loudness: LoudnessNormaliser | None = None
    ) -> None:
        intervals = intervals or Intervals()
        self._shortest, self._longest = (
            round(interval * SAMPLE_RATE / HOP) for interval in (intervals.shortest, intervals.longest)
        )
        self._windows, self._onsets = WindowStream(loudness), OnsetStream()
        self._received = 0
        self._window = 0
        self._last: int | None = None
        self._coming: deque[int] = deque()
        self._spoken: deque[int] = deque()

    def push(self, samples: np.ndarray) -> np.ndarray:
        """Take in the next samples.

        Args:
            samples: (n,) mono samples at audio.SAMPLE_RATE, full scale 1; any n.

        Returns:
            (m,) the beats that are known with them [s from the start of the signal].

        Raises:
            InvalidValueError: The samples are not one channel of finite numbers; the stream is as before.
        """
        windows = self._windows.push(samples)
        self._received += len(samples)
        self._coming += self._onsets.push(windows)
        levels = decibels(np.mean(windows**2, axis=1), _FLOOR)
        self._spoken += (self._window + np.flatnonzero(levels > NOISE_LEVEL)).tolist()
        self._window += len(windows)
        beats = []
        while (beat := self._next()) is not None:
            beats.append(beat)
            self._last = beat
        return (HOP * np.array(beats, float) + WINDOW_LENGTH / 2) / SAMPLE_RATE

    def flush(self) -> np.ndarray:
        """End the signal: the beats that the sound up to its last sample still holds, (m,) [s]."""
        end = self._received / SAMPLE_RATE
        beats = self.push(np.zeros(AVERAGED * HOP + WINDOW_LENGTH + HOP))
        return beats[beats < end]

    def _next(self) -> int | None:
        """The window of the next beat, where it can be told already."""
        known = self._onsets.known
        if self._last is None:
            if self._coming:
                return self._coming[0]
            _drop(self._spoken, known)
            return None
        earliest, latest = self._last + self._shortest, self._last + self._longest
        _drop(self._coming, earliest)
        _drop(self._spoken, earliest)
        onset = self._coming[0] if self._coming else _NEVER
        spoken = self._spoken[0] if self._spoken else _NEVER
        if onset <= latest:
            return onset
        if known <= latest:
            return None
        # A gap. The silence in it ends with the next sound.
        end = spoken if spoken + self._shortest <= onset else onset
        if end > latest and end > self._last + 2 * self._longest:
            return latest if known > self._last + 2 * self._longest else None
        if end < onset and known <= end + self._shortest:
            return None
        return end if end <= latest else (self._last + end) // 2


def _drop(moments: deque[int], before: int) -> None:
    while moments and moments[0] < before:
        moments.popleft()
