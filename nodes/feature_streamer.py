"""Sound in; a frame, one vector of speech features and whether somebody speaks out."""

from collections import defaultdict, deque
from typing import Any

import numpy as np
import soxr

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.frames import first_frame_after, frame_time
from gesture_bot.msg import Audio, SpeechFeatures
from gesture_bot.nodes.node import STREAM, GestureNode, seconds, stamp
from gesture_bot.speech.activity import ActivityStream
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.features import FeatureStream
from gesture_bot.speech.loudness import LoudnessNormaliser


class FeatureStreamer(GestureNode):
    """Cuts each utterance into frames of 1/15 s on the grid and publishes their features."""

    def __init__(self, name: str = "feature_streamer", **options: Any):
        super().__init__(name, **options)
        self._publisher = self.create_publisher(SpeechFeatures, "speech/features", STREAM)
        self._utterance: tuple[str, int] | None = None
        self._activity = ActivityStream()
        self._spoken: deque[bool] = deque()
        self._loudness: defaultdict[str, LoudnessNormaliser] = defaultdict(LoudnessNormaliser)
        self.listen(Audio, "speech/audio", self._on_audio, STREAM)
        self.waits_for("sound on speech/audio")

    def _on_audio(self, audio: Audio) -> None:
        samples = np.asarray(audio.samples, np.float32)
        if not audio.sample_rate or not np.isfinite(samples).all():
            raise InvalidValueError(
                "sound needs a sample rate and finite samples; got rate", audio.sample_rate
            )
        utterance = (audio.header.frame_id, audio.utterance)
        if utterance != self._utterance:
            self._begin(audio, utterance)
        samples = self._resampler.resample_chunk(samples, last=audio.last)
        skipped = min(self._skip, len(samples))
        self._skip -= skipped
        self._publish(self._stream.push(samples[skipped:]), self._activity.push(samples[skipped:]))
        if audio.last:
            self._publish(self._stream.flush(), self._activity.flush())
            self._utterance = None

    def _begin(self, audio: Audio, utterance: tuple[str, int]) -> None:
        heard = seconds(audio.header.stamp)
        self._utterance = utterance
        self._frame = first_frame_after(heard)
        # Sound from a microphone begins anywhere: what lies before the first whole frame is left out.
        self._skip = max(0, round((frame_time(self._frame) - heard) * SAMPLE_RATE))
        self._resampler = soxr.ResampleStream(audio.sample_rate, SAMPLE_RATE, 1, dtype="float32")
        self._stream = FeatureStream(self._loudness[audio.header.frame_id])
        self._activity.flush()
        self._spoken.clear()

    def _publish(self, frames: np.ndarray, activity: np.ndarray) -> None:
        assert self._utterance
        self._spoken.extend(activity)  # it is known a little earlier than the features
        for features in frames:
            speech = bool(self._spoken.popleft())
            message = SpeechFeatures(features=features.astype(np.float32), speech=speech)
            message.header.stamp = stamp(frame_time(self._frame))
            message.header.frame_id, message.utterance = self._utterance
            self._publisher.publish(message)
            self._frame += 1
