"""Plays what the robot says on the sound card, each sample at its moment."""

from typing import Any

import numpy as np
import soxr

from gesture_bot.base.errors import DeviceError, InvalidValueError
from gesture_bot.msg import Audio, Cut
from gesture_bot.nodes.managed import ManagedNode
from gesture_bot.nodes.node import PLAN, STREAM, diagnostic, seconds
from gesture_bot.speech import devices
from gesture_bot.speech.cuts import Cuts

PLAYED = ("voice", "file")
"""Sources of speech_source. Other programs play their own sound."""

LOST = 0.1
"""A piece that is so much later than the one before ends is not the next one [s]."""

AGAIN = 2.0
"""From one try to open a sound card to the next [s]."""


class Loudspeaker(ManagedNode):
    """Plays text and sound files. Without a sound card, the robot gestures in silence, in the same time.

    The sound card is taken while the node is active.
    """

    def __init__(self, name: str = "loudspeaker", **options: Any):
        super().__init__(name, **options)
        self._device = self.parameter(
            "loudspeaker", "default", "Sound card that plays speech: 'default', 'off', or a part of its name"
        )
        self._loudspeaker: devices.Loudspeaker | None = None
        self._trouble = ""
        self._utterance: tuple[str, int] | None = None
        self._next = 0.0
        self._cuts = Cuts()
        if self._device != "off":
            self.listen(Audio, "speech/audio", self._on_audio, STREAM)
            self.listen(Cut, "speech/cut", self._on_cut, PLAN)
        self.every(AGAIN, self._check)
        self.bring_up()
        self.waits_for("nothing: it is switched off" if self._device == "off" else "sound on speech/audio")

    def activate(self) -> None:
        """Take the sound card, or wait for one."""
        if self._device != "off":
            self._open()

    def deactivate(self) -> None:
        """Fall silent, and give the sound card back."""
        if self._loudspeaker:
            self._loudspeaker.close()
        self._loudspeaker = None

    cleanup = deactivate

    def _open(self) -> None:
        try:
            self._loudspeaker = devices.Loudspeaker(self._device)
            self._utterance = None
            self._trouble = ""
        except DeviceError as error:
            if str(error) != self._trouble:
                self.get_logger().warning(f"speech is not played: {error}")
            self._trouble = str(error)

    def _check(self) -> None:
        """Open a sound card that has come, or come back, and say how it is."""
        if self._device == "off" or self.state != "active":
            idle = "switched off" if self._device == "off" else self.state
            self.diagnose(diagnostic("loudspeaker", [], idle))
            return
        if self._loudspeaker and not self._loudspeaker.works:
            self._loudspeaker.close()
            self._loudspeaker = None
        if not self._loudspeaker:
            self._open()
        troubles = [self._trouble] if self._trouble else []
        self.diagnose(
            diagnostic("loudspeaker", troubles + self.errors(), "running", hardware_id=self._device)
        )

    def _on_audio(self, audio: Audio) -> None:
        source, moment = audio.header.frame_id, seconds(audio.header.stamp)
        if not self._loudspeaker or source not in PLAYED or self._cuts.void(source, audio.utterance, moment):
            return
        if not audio.sample_rate:
            raise InvalidValueError("sound needs a sample rate; got", audio.sample_rate, ["1 Hz and more"])
        playback = self._loudspeaker.playback
        if self._utterance != (source, audio.utterance) or moment - self._next > LOST:
            self._utterance = source, audio.utterance
            self._resampler = soxr.ResampleStream(audio.sample_rate, playback.rate, 1, dtype="float32")
            self._next = moment
        samples = np.asarray(audio.samples, np.float32)
        # What the resampler still holds belongs before the piece, so that pieces follow each other evenly.
        resampled = self._resampler.resample_chunk(samples, last=audio.last)
        playback.put(self._next, resampled, audio.utterance)
        self._next += len(resampled) / playback.rate

    def _on_cut(self, cut: Cut) -> None:
        moment = seconds(cut.header.stamp)
        self._cuts.add(cut.header.frame_id, cut.utterance, moment)
        if self._loudspeaker and cut.header.frame_id in PLAYED:
            self._loudspeaker.playback.cut(moment, cut.utterance)
