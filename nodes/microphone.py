"""What is said to the robot: sound from a microphone or from audio_common, without the robot's own noise."""

from contextlib import suppress
from typing import Any

import numpy as np
from rclpy.impl.implementation_singleton import rclpy_implementation
from trajectory_msgs.msg import JointTrajectory

from gesture_bot.base.errors import DeviceError, InvalidValueError
from gesture_bot.msg import Audio, Cut
from gesture_bot.nodes import audio_common
from gesture_bot.nodes.managed import ManagedNode
from gesture_bot.nodes.messages import trajectory_from
from gesture_bot.nodes.node import PLAN, STREAM, diagnostic, seconds, stamp
from gesture_bot.speech import devices
from gesture_bot.speech.gate import MicrophoneGate
from gesture_bot.speech.liveness import Liveness

SOURCE = "microphone"
"""frame_id of its sound."""

STILL = 0.05
"""Joints that are slower than this make no noise [rad/s]."""

AGAIN = 2.0
"""From one look at the device to the next [s]."""

MUTED = 10.0
"""Digital silence of this length means that a microphone is muted, or not plugged in [s]."""

HOLE = 0.5
"""Sound without stamps that comes so much later than the last is not its continuation [s]."""

RCLError = rclpy_implementation.RCLError


class Microphone(ManagedNode):
    """Publishes what others say, stamped with the moment of recording.

    The sound card is taken while the node is active.
    """

    def __init__(self, name: str = "microphone", **options: Any):
        super().__init__(name, **options)
        self._device = self.parameter(
            "microphone",
            "off",
            "Where others are heard: 'off', 'default', a part of a sound card's name, or 'topic' "
            "(audio_common_msgs on `audio`)",
        )
        own_voice = self.parameter(
            "listen_while_speaking",
            False,
            "Whether others are heard while the robot speaks, and its own voice",
        )
        self._gate, self._liveness = MicrophoneGate(), Liveness()
        self._microphone: devices.Microphone | None = None
        self._trouble = ""
        self._utterance = 0
        self._until = 0.0
        self._sounded = 0.0
        self.every(AGAIN, self._check)
        if self._device == "off":
            self.bring_up()
            self.waits_for("nothing: it is switched off")
            return
        self._audio = self.create_publisher(Audio, "speech/audio", STREAM)
        if not own_voice:
            self.listen(Audio, "speech/audio", self._on_audio, STREAM)
            self.listen(Cut, "speech/cut", self._on_cut, PLAN)
        self.listen(JointTrajectory, "joint_trajectory", self._on_trajectory, PLAN)
        if self._device == "topic":
            audio_common.listen(self, self._on_topic)
        self.bring_up()
        self.waits_for("sound on audio" if self._device == "topic" else "sound from the microphone")

    def activate(self) -> None:
        """Take the sound card, or wait for one."""
        self._sounded = self.now()
        if self._device not in ("off", "topic"):
            self._open()

    def deactivate(self) -> None:
        """Hear no more, and give the sound card back."""
        if self._microphone:
            self._microphone.close()
        self._microphone = None

    cleanup = deactivate

    def _open(self) -> None:
        try:
            self._utterance += 1
            self._microphone = devices.Microphone(self._device, self._hear)
            self._trouble = ""
        except DeviceError as error:
            if str(error) != self._trouble:
                self.get_logger().warning(f"nobody is heard: {error}")
            self._trouble = str(error)

    def _check(self) -> None:
        """Open a microphone that has come, or come back, and say how it is."""
        if self._device == "off" or self.state != "active":
            idle = "switched off" if self._device == "off" else self.state
            self.diagnose(diagnostic("microphone", [], idle))
            return
        if self._device != "topic":
            if self._microphone and not (self._microphone.works and self.now() - self._until < AGAIN):
                self._microphone.close()
                self._microphone = None
            if not self._microphone:
                self._open()
        troubles = [self._trouble] if self._trouble else []
        if not troubles and self.now() - self._until > MUTED:
            troubles = ["no sound comes"]
        elif not troubles and self.now() - self._sounded > MUTED:
            troubles = ["digital silence: is the microphone muted?"]
        self.diagnose(diagnostic("microphone", troubles + self.errors(), "running", hardware_id=self._device))

    def _on_topic(self, moment: float | None, rate: int, samples: np.ndarray) -> None:
        if self.state != "active":
            return
        if rate <= 0:
            raise InvalidValueError("sample rate of the sound on audio", rate, ["1 Hz and more"])
        if moment is None:
            arrived = self.now() - len(samples) / rate
            moment = self._until if abs(arrived - self._until) < HOLE else arrived
        self._publish(moment, rate, samples)

    def _hear(self, moment: float, rate: int, samples: np.ndarray) -> None:
        """Take a block from the sound card, in PortAudio's thread."""
        with suppress(RCLError):  # the graph may end between two blocks
            self._publish(moment, rate, samples)

    def _publish(self, moment: float, rate: int, samples: np.ndarray) -> None:
        if samples.any():
            self._sounded = self.now()
        message = Audio(utterance=self._utterance, sample_rate=rate)
        message.header.stamp, message.header.frame_id = stamp(moment), SOURCE
        message.samples.frombytes(self._gate.passed(moment, rate, samples).astype(np.float32).tobytes())
        self._audio.publish(message)
        self._until = moment + len(samples) / rate

    def _on_audio(self, audio: Audio) -> None:
        source, begin = audio.header.frame_id, seconds(audio.header.stamp)
        # What is announced is the robot's own; others that speak live are no reason to be deaf.
        if audio.sample_rate and not self._liveness.is_live(source, audio.utterance, begin, self.now()):
            self._gate.speaks(begin, begin + len(audio.samples) / audio.sample_rate)

    def _on_cut(self, cut: Cut) -> None:
        if cut.header.frame_id != SOURCE:
            self._gate.silent_from(seconds(cut.header.stamp))

    def _on_trajectory(self, message: JointTrajectory) -> None:
        trajectory = trajectory_from(message, self.now())
        speed = float(np.abs(trajectory.velocities).max())
        if speed > STILL:
            self._gate.moves(trajectory.times[0], trajectory.times[-1], speed)
