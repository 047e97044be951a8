"""The sound card, through PortAudio: the robot's loudspeaker and its microphone."""

import time
from collections.abc import Callable
from functools import cache
from types import ModuleType
from typing import Any

import numpy as np

from gesture_bot.base.errors import DeviceError
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.playback import Playback

BLOCK = 0.032
"""Sound comes from a microphone in pieces of this length [s]."""

LATENCY = 0.1
"""The sound card's buffer: Python may be busy for so long without a gap in the sound [s]."""

DEFAULT = "default"
"""The name of the device that the system prefers."""

_KINDS = {"input": "microphone", "output": "loudspeaker"}

_open: set[object] = set()


class Microphone:
    """An open microphone. Its blocks come in a thread of PortAudio's.

    Args:
        device: DEFAULT, or a part of the device's name.
        on_block: Called with the moment at which the first sample was recorded [s since the epoch], the
            sample rate [Hz], and the (n,) float32 samples of all channels' mean.

    Raises:
        DeviceError: PortAudio or the device is missing, or does not work; lists the microphones.
    """

    def __init__(self, device: str, on_block: Callable[[float, int, np.ndarray], None]) -> None:
        rate, channels = _settings(device, "input")

        def on_sound(sound: np.ndarray, _frames: int, clock: Any, _status: object) -> None:
            recorded = time.time() - (clock.currentTime - clock.inputBufferAdcTime)
            on_block(recorded, rate, sound.mean(axis=1))

        self._stream = _opened(
            "InputStream",
            device,
            samplerate=rate,
            channels=channels,
            blocksize=round(BLOCK * rate),
            callback=on_sound,
        )

    @property
    def works(self) -> bool:
        """Whether it still gives sound."""
        return bool(self._stream.active)

    def close(self) -> None:
        """Give the device back."""
        _closed(self._stream)


class Loudspeaker:
    """An open loudspeaker, which plays what is put into its `playback` at its moment.

    Args:
        device: DEFAULT, or a part of the device's name.

    Raises:
        DeviceError: PortAudio or the device is missing, or does not work; lists the loudspeakers.
    """

    def __init__(self, device: str) -> None:
        rate, channels = _settings(device, "output")
        self.playback = Playback(rate)

        def on_request(sound: np.ndarray, frames: int, clock: Any, _status: object) -> None:
            heard = time.time() + (clock.outputBufferDacTime - clock.currentTime)
            sound[:] = self.playback.read(heard, frames)[:, None]

        self._stream = _opened(
            "OutputStream", device, samplerate=rate, channels=channels, callback=on_request
        )

    @property
    def works(self) -> bool:
        """Whether it still plays."""
        return bool(self._stream.active)

    def close(self) -> None:
        """Give the device back."""
        _closed(self._stream)


@cache
def _library() -> ModuleType | DeviceError:
    """The sounddevice package, or why there is none; which does not change, and takes a while to find out."""
    try:
        import sounddevice
    except OSError as error:
        reason = str(error).lower()
        return DeviceError(f"no sound card can be used ({reason}): sudo apt install libportaudio2")
    except Exception as error:  # PortAudio does not start: its error has no name without the package
        return DeviceError(f"no sound card can be used ({error})")
    return sounddevice


def _portaudio() -> ModuleType:
    """The sounddevice package."""
    library = _library()
    if isinstance(library, DeviceError):
        raise library
    return library


def device_names(direction: str) -> list[str]:
    """The names of the microphones ("input") or loudspeakers ("output") that are there now.

    Raises:
        DeviceError: There is none, or PortAudio is missing.
    """
    portaudio = _portaudio()
    try:
        if not _open:
            # PortAudio lists its devices once, when it starts.
            portaudio._terminate()
            portaudio._initialize()
        names = [d["name"] for d in portaudio.query_devices() if d[f"max_{direction}_channels"]]
    except portaudio.PortAudioError as error:
        raise DeviceError(f"no sound card can be used ({error})") from error
    if not names:
        raise DeviceError(f"there is no {_KINDS[direction]} on this machine")
    return names


def _settings(device: str, direction: str) -> tuple[int, int]:
    """SAMPLE_RATE where a device takes it, which needs no resampling, else its own [Hz]; and its channels."""
    portaudio, names = _portaudio(), device_names(direction)
    try:
        found = portaudio.query_devices(None if device == DEFAULT else device, direction)
    except (ValueError, portaudio.PortAudioError) as error:
        raise DeviceError(f"{_KINDS[direction]} not found", device, [DEFAULT, *names]) from error
    rate, channels = SAMPLE_RATE, min(found[f"max_{direction}_channels"], 2)
    try:
        check = getattr(portaudio, f"check_{direction}_settings")
        check(None if device == DEFAULT else device, channels=channels, samplerate=rate)
    except portaudio.PortAudioError:
        rate = round(found["default_samplerate"])
    return rate, channels


def _opened(kind: str, device: str, **settings: Any) -> Any:
    portaudio = _portaudio()
    try:
        stream = getattr(portaudio, kind)(
            device=None if device == DEFAULT else device, dtype="float32", latency=LATENCY, **settings
        )
    except portaudio.PortAudioError as error:
        raise DeviceError(f"the sound card cannot be opened ({error})", device) from error
    try:
        stream.start()
    except portaudio.PortAudioError as error:
        stream.close(ignore_errors=True)
        raise DeviceError(f"the sound card cannot be started ({error})", device) from error
    _open.add(stream)
    return stream


def _closed(stream: Any) -> None:
    _open.discard(stream)
    stream.close(ignore_errors=True)
