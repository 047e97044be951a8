"""Sound in; one vector of speech features a frame, and the beats of the speech, out."""

from typing import Any

import numpy as np
import soxr

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.frames import first_frame_after, frame_time
from gesture_bot.msg import Audio, SpeechFeatures
from gesture_bot.nodes.node import STREAM, GestureNode, seconds, stamp
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.beats import BeatStream, load_intervals
from gesture_bot.speech.features import FeatureStream


class FeatureStreamer(GestureNode):
    """Cuts each utterance into frames of 1/15 s on the grid and publishes their features."""

    def __init__(self, name: str = "feature_streamer", **options: Any):
        super().__init__(name, **options)
        language = self.parameter(
            "language", "en", "Code of the language that is spoken; its beats are those of config/beats.yaml"
        )
        self._intervals = load_intervals(language)
        self._publisher = self.create_publisher(SpeechFeatures, "speech/features", STREAM)
        self._utterance: tuple[str, int] | None = None
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
        samples = samples[skipped:]
        self._publish(self._stream.push(samples), self._beats.push(samples))
        if audio.last:
            self._publish(self._stream.flush(), self._beats.flush())
            self._utterance = None

    def _begin(self, audio: Audio, utterance: tuple[str, int]) -> None:
        heard = seconds(audio.header.stamp)
        self._utterance = utterance
        self._frame = first_frame_after(heard)
        # Sound from a microphone begins anywhere: what lies before the first whole frame is left out.
        self._skip = max(0, round((frame_time(self._frame) - heard) * SAMPLE_RATE))
        self._resampler = soxr.ResampleStream(audio.sample_rate, SAMPLE_RATE, 1, dtype="float32")
        self._stream, self._beats = FeatureStream(), BeatStream(self._intervals)
        self._begun, self._waiting = self._frame, np.zeros(0)

    def _publish(self, frames: np.ndarray, beats: np.ndarray) -> None:
        assert self._utterance
        self._waiting = np.concatenate([self._waiting, beats])
        for features in frames:
            message = SpeechFeatures(features=features.astype(np.float32))
            message.header.stamp = stamp(frame_time(self._frame))
            message.header.frame_id, message.utterance = self._utterance
            # Frames are not held up until their beats are known; those come with a later one.
            message.beats = (self._waiting - frame_time(self._frame - self._begun)).tolist()
            self._waiting = np.zeros(0)
            self._publisher.publish(message)
            self._frame += 1
