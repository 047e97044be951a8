"""Sound in; out come, a frame, speech features, whether somebody speaks, and the beats of the speech."""

from typing import Any

import numpy as np

from gesture_bot.base.frames import frame_time
from gesture_bot.msg import Audio, Cut, SpeechFeatures
from gesture_bot.nodes.node import PLAN, STREAM, GestureNode, diagnostic, seconds, stamp
from gesture_bot.speech.beats import load_intervals
from gesture_bot.speech.cuts import Cuts
from gesture_bot.speech.streaming import Packet, SpeechStream

SOURCES = 8
"""So many sources are known at once."""


class FeatureStreamer(GestureNode):
    """Cuts the sound of each source into frames of 1/15 s on the grid and publishes their features."""

    def __init__(self, name: str = "feature_streamer", **options: Any):
        super().__init__(name, **options)
        language = self.parameter(
            "language", "en", "Code of the language that is spoken; its beats are those of config/beats.yaml"
        )
        self._intervals = load_intervals(language)
        self._streams: dict[str, SpeechStream] = {}
        self._cuts = Cuts()
        self._publisher = self.create_publisher(SpeechFeatures, "speech/features", STREAM)
        self.listen(Audio, "speech/audio", self._on_audio, STREAM)
        self.listen(Cut, "speech/cut", self._on_cut, PLAN)
        self.every(1.0, self._report)
        self.waits_for("sound on speech/audio")

    def _on_audio(self, audio: Audio) -> None:
        source, moment = audio.header.frame_id, seconds(audio.header.stamp)
        if self._cuts.void(source, audio.utterance, moment):
            return
        # In the order in which they were heard last; each one takes some memory.
        stream = self._streams.pop(source) if source in self._streams else SpeechStream(self._intervals)
        self._streams[source] = stream
        while len(self._streams) > SOURCES:
            del self._streams[next(iter(self._streams))]
        packet = Packet(
            audio.utterance,
            moment,
            audio.sample_rate,
            np.asarray(audio.samples, np.float32),
            audio.last,
        )
        for frame in stream.push(packet, self.now()):
            message = SpeechFeatures(features=frame.features.astype(np.float32), speech=frame.speech)
            message.beats = list(frame.beats)
            message.header.stamp = stamp(frame_time(frame.index))
            message.header.frame_id, message.utterance = source, audio.utterance
            self._publisher.publish(message)

    def _on_cut(self, cut: Cut) -> None:
        self._cuts.add(cut.header.frame_id, cut.utterance, seconds(cut.header.stamp))
        if stream := self._streams.get(cut.header.frame_id):
            stream.end(cut.utterance)

    def _report(self) -> None:
        now = self.now()
        self.diagnose(
            diagnostic("feature streamer", self.errors(), "running", sources=len(self._streams)),
            *(
                diagnostic(
                    f"sound of {source or 'an unnamed source'}",
                    stream.troubles(now),
                    "running" if stream.until is not None else "silent",
                    sample_rate=stream.rate,
                    lost_s=f"{stream.lost:.2f}",
                    late_s=f"{stream.late:.2f}",
                    clipped_s=f"{stream.clipped:.3f}",
                )
                for source, stream in self._streams.items()
            ),
        )
