"""The speech that motion goes with: announced or heard live, of one speaker or of several."""

import math

import numpy as np

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.frames import FRAME_RATE, WINDOW
from gesture_bot.corpus.database import Database
from gesture_bot.matching.features import AUDIO_OFFSETS
from gesture_bot.matching.speaker import Speaker, speech_statistics
from gesture_bot.speech.features import FEATURES, SILENCE_FEATURES

ONSET = 6
"""Frames before speech is detected at which motion begins: a gesture is prepared before its word.

Four before its first sound, which is up to two frames earlier.
"""

SHORTEST = WINDOW // 2
"""Where speech ends within less than this many frames, no window is searched for them."""

_SILENCE = SILENCE_FEATURES, False


class Hearing:
    """Frames of speech where their motion belongs, in the voice of the database.

    Args:
        database: Whose voice it is.

    Attributes:
        announced: The last frame of speech that was announced, such as the robot's own.
        beats: Of the speech [frames].
    """

    def __init__(self, database: Database) -> None:
        self._voice = speech_statistics(database)
        self._speakers: dict[str, Speaker] = {}
        self._heard: dict[int, tuple[np.ndarray, bool]] = {}
        self.announced = self._last_heard = -WINDOW
        self.beats: list[float] = []

    def add_features(
        self, frame: int, features: np.ndarray, speech: bool, speaker: str = "", live: bool = False
    ) -> None:
        """Take in the sound of a frame.

        Args:
            frame: Index on the grid, where its motion belongs.
            features: (28,) speech features; see speech.features.
            speech: Whether somebody speaks in it; see speech.activity.
            speaker: Where it comes from: a speaker's features are brought to the database's voice.
            live: Whether it was heard before this call, as from a microphone. What is announced, such as the
                robot's own voice, goes first.

        Raises:
            InvalidValueError: They are not 28 finite numbers.
        """
        if np.shape(features) != (FEATURES,) or not np.isfinite(features).all():
            raise InvalidValueError(
                f"speech features of frame {frame}", features, [f"{FEATURES} finite numbers"]
            )
        if speaker not in self._speakers:
            self._speakers[speaker] = Speaker(*self._voice)
        features = self._speakers[speaker].push(np.asarray(features), speech)
        # Of two that are heard live, the one who speaks counts.
        if live and (frame <= self.announced or (not speech and self._heard.get(frame, _SILENCE)[1])):
            return
        self._hear(frame, features, speech)
        if not live:
            self.announced = frame

    def add_beat(self, moment: float) -> None:
        """Take in a beat of the speech; see speech.beats.

        Args:
            moment: On the clock of the plan [s since the epoch].

        Raises:
            InvalidValueError: It is not finite.
        """
        if not math.isfinite(moment):
            raise InvalidValueError("moment of a beat", moment, ["a finite number"])
        self.beats.append(moment * FRAME_RATE)

    def cut(self, frame: int) -> None:
        """Nothing of what was announced is heard from a frame on."""
        self._heard = {earlier: heard for earlier, heard in self._heard.items() if earlier < frame}
        self._hear(frame, *_SILENCE)
        self.announced = frame
        self.beats = [beat for beat in self.beats if beat < frame]

    def forget(self, before: int) -> None:
        """Drop what was heard before a frame."""
        self._heard = {frame: heard for frame, heard in self._heard.items() if frame >= before}
        self.beats = [beat for beat in self.beats if beat >= before]

    def speaks(self, frame: int) -> bool:
        """Whether a frame is speech; up to a window after the last one known, it is taken to be like that."""
        if frame not in self._heard and self._last_heard < frame <= self._last_heard + WINDOW:
            frame = self._last_heard
        return self._heard.get(frame, _SILENCE)[1]

    def _prepares(self, start: int) -> bool:
        """Whether there is speech in a window that begins here, or so soon after that it prepares for it."""
        return any(self.speaks(frame) for frame in range(start, start + WINDOW + ONSET))

    def spoken(self, start: int, frames: int) -> int:
        """How many of the frames from one on go with speech: up to its end, where that is known."""
        for frame in range(start, start + frames):
            if not self._prepares(frame) and (frame == start or frame <= self._last_heard):
                # Too few of them would be a jump.
                return frame - start if frame - start >= SHORTEST else 0
        return frames

    def sound(self, start: int) -> np.ndarray:
        """(m, 28) the sound from a frame on, up to what is known of it where it is live."""
        stop = start + AUDIO_OFFSETS[-1] + 1
        if self._last_heard > self.announced:
            # The search takes what is still to come to be like the last frame.
            stop = min(stop, max(self._last_heard, start) + 1)
        return self.features(start, stop)

    def features(self, start: int, stop: int) -> np.ndarray:
        """(stop - start, 28) the sound of some frames; what is not known is silence."""
        return np.array([self._heard.get(frame, _SILENCE)[0] for frame in range(start, stop)])

    def _hear(self, frame: int, features: np.ndarray, speech: bool) -> None:
        self._heard[frame] = features, speech
        self._last_heard = frame
