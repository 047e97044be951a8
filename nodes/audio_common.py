"""Sound from audio_common_msgs, of which there are two packages; whichever is installed is understood."""

from collections.abc import Callable
from typing import Any

import numpy as np

from gesture_bot.base.errors import DeviceError, InvalidValueError
from gesture_bot.nodes.node import STREAM, GestureNode, seconds
from gesture_bot.speech.encodings import from_bytes, from_numbers

try:
    import audio_common_msgs.msg as messages
except ImportError:  # neither is installed
    messages = None

OnSound = Callable[[float | None, int, np.ndarray], None]
"""Takes the moment of the first sample where it is known [s since the epoch], the rate [Hz], the samples."""


def listen(node: GestureNode, on_sound: OnSound) -> None:
    """Hear what comes on `audio` (and `audio_stamped` with `audio_info`), in any rate and channel count.

    AudioStamped is mgonzs13's; AudioData, AudioDataStamped and AudioInfo are those of ros-drivers.

    Raises:
        DeviceError: The package is not installed.
    """
    if messages is None:
        raise DeviceError(
            "sound from a topic needs the ROS package audio_common_msgs, which is not installed"
        )
    if hasattr(messages, "AudioStamped"):
        node.listen(messages.AudioStamped, "audio", lambda message: _on_stamped(message, on_sound), STREAM)
    else:
        _Capture(node, on_sound)


def _on_stamped(message: Any, on_sound: OnSound) -> None:
    info, data = message.audio.info, message.audio.audio_data
    fields = (data.float32_data, data.int32_data, data.int16_data, data.int8_data, data.uint8_data)
    kinds = (np.float32, np.int32, np.int16, np.int8, np.uint8)
    for field, kind in zip(fields, kinds, strict=True):
        if len(field):
            sound = from_numbers(np.asarray(field, kind), info.channels)
            on_sound(seconds(message.header.stamp) or None, info.rate, sound)


class _Capture:
    """The topics of ros-drivers' audio_capture, which sends the same sound with and without a stamp."""

    def __init__(self, node: GestureNode, on_sound: OnSound) -> None:
        self._on_sound = on_sound
        self._info: Any = None
        self._stamped = False
        node.listen_to_state(messages.AudioInfo, "audio_info", self._on_info)
        node.listen(messages.AudioDataStamped, "audio_stamped", self._on_stamped, STREAM)
        node.listen(messages.AudioData, "audio", self._on_plain, STREAM)

    def _on_info(self, info: Any) -> None:
        if info.coding_format.lower() not in ("", "wave", "raw"):
            raise InvalidValueError("coding of the sound on audio", info.coding_format, ["wave"])
        self._info = info

    def _on_stamped(self, message: Any) -> None:
        self._stamped = True
        self._hear(seconds(message.header.stamp) or None, message.audio)

    def _on_plain(self, message: Any) -> None:
        if not self._stamped:
            self._hear(None, message)

    def _hear(self, moment: float | None, audio: Any) -> None:
        if self._info:
            sound = from_bytes(bytes(audio.data), self._info.sample_format, self._info.channels)
            self._on_sound(moment, self._info.sample_rate, sound)
