"""Sound in, the words in it out."""

from typing import Any

import numpy as np
import soxr
from rclpy.timer import Timer

from gesture_bot.base.errors import GestureBotError, InvalidValueError
from gesture_bot.matching.banks import WatchedBanks, triggers
from gesture_bot.msg import Audio, Cut
from gesture_bot.msg import Word as WordMessage
from gesture_bot.nodes.node import PLAN, STREAM, GestureNode, diagnostic, seconds, stamp
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.cuts import Cuts
from gesture_bot.speech.recogniser import RecognisedWord
from gesture_bot.speech.recogniser_process import Key, RecogniserProcess

OTHERS = "others"
"""Every source but the robot's voice, which tells its own words."""

VOICE = "voice"

SILENT = 1.0
"""A source that is silent for so long gives way to another [s]."""

STALE = 5.0
"""Older sound is not listened to [s]."""

PAUSE = 10.0
"""From the end of a process that failed to the start of the next [s]."""


class WordRecogniser(GestureNode):
    """Recognises the words of sound that brings none; its process starts with the first such sound."""

    def __init__(self, name: str = "word_recogniser", **options: Any):
        super().__init__(name, **options)
        banks = self.parameter("banks", "shipped", "Semantic banks: a folder of YAML files, or 'shipped'")
        self._sources = self.parameter(
            "sources",
            [OTHERS],
            f"Sources (frame_id of the sound) that are recognised; '{OTHERS}': every one but '{VOICE}'",
        )
        self._banks = WatchedBanks(banks)
        self._process: RecogniserProcess | None = None
        self._looking: Timer | None = None
        self._again = self._sounded = 0.0
        self._signal: tuple[str, int, int] | None = None
        self._cuts = Cuts()
        self._words = self.create_publisher(WordMessage, "speech/words", PLAN)
        self.listen(Audio, "speech/audio", self._on_audio, STREAM)
        self.listen(Cut, "speech/cut", self._on_cut, PLAN)
        self.every(1.0, self._report)
        self.every(1.0, self._reload)
        self.waits_for("sound without words on speech/audio")

    def destroy_node(self) -> None:
        """End the process."""
        if self._process:
            self._process.close()
        super().destroy_node()

    def _on_cut(self, cut: Cut) -> None:
        self._cuts.add(cut.header.frame_id, cut.utterance, seconds(cut.header.stamp))

    def _on_audio(self, audio: Audio) -> None:
        source = audio.header.frame_id
        if source not in self._sources and not (OTHERS in self._sources and source != VOICE):
            return
        samples, moment = np.asarray(audio.samples, np.float32), seconds(audio.header.stamp)
        if not audio.sample_rate or not np.isfinite(samples).all():
            raise InvalidValueError(
                "sound needs a sample rate and finite samples; got rate", audio.sample_rate
            )
        now = self.now()
        if moment < now - STALE or self._cuts.void(source, audio.utterance, moment):
            return
        # One source is listened to at a time: another one may begin when it has fallen silent.
        if samples.any():
            if self._signal and self._signal[0] != source and now < self._sounded + SILENT:
                return
            self._sounded = now
        elif not self._signal or self._signal[0] != source:
            return
        if not self._process:
            if now < self._again:
                return
            self._process = RecogniserProcess(triggers(self._banks.gestures))
            self._looking = self._looking or self.every(0.02, self._publish)
        if self._signal != (signal := (source, audio.utterance, audio.sample_rate)):
            self._signal = signal
            self._resampler = soxr.ResampleStream(audio.sample_rate, SAMPLE_RATE, 1, dtype="float32")
            self._held = 0.0
        # The resampler gives sound out a little later than it takes it in.
        moment -= self._held
        resampled = self._resampler.resample_chunk(samples, last=audio.last)
        self._held += len(samples) / audio.sample_rate - len(resampled) / SAMPLE_RATE
        self._process.push((source, audio.utterance), moment, resampled, audio.last)
        if audio.last:
            self._signal = None
        self._publish()

    def _publish(self) -> None:
        if not self._process:
            return
        try:
            words = self._process.words()
        except GestureBotError:
            self._process, self._again = None, self.now() + PAUSE
            raise
        for key, word in words:
            message = _message(key, word)
            if not self._cuts.void(message.header.frame_id, message.utterance, word.start):
                self._words.publish(message)

    def _reload(self) -> None:
        if self._banks.changed() and self._process:
            self._process.set_phrases(triggers(self._banks.gestures))

    def _report(self) -> None:
        process, troubles = self._process, self.errors()
        dropped = process.dropped if process else 0.0
        troubles += process.problems if process else []
        if dropped:
            troubles.append(f"too slow: {dropped:.1f} s of sound were dropped")
        healthy = "hears" if process else "waits for sound without words"
        self.diagnose(diagnostic("word recogniser", troubles, healthy, dropped_s=f"{dropped:.1f}"))


def _message(key: Key, word: RecognisedWord) -> WordMessage:
    source, utterance = key
    message = WordMessage(text=word.text, utterance=utterance, duration=word.end - word.start)
    message.stress = word.stress - word.start
    message.confidence = word.confidence
    message.header.stamp, message.header.frame_id = stamp(word.start), source
    return message
