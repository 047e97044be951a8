"""A sound card for tests, imported in place of the package sounddevice.

What is played goes to the file PLAYED as rows of (moment it is heard, sample). The microphone hears a tone.
It is broken while the file BROKEN exists. Paths come from the environment.
"""

import os
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np

LATENCY = 0.05


class PortAudioError(Exception):
    pass


def _initialize():
    pass


_terminate = _initialize


def _broken():
    return Path(os.environ["BROKEN"]).exists()


def query_devices(device=None, kind=None):
    card = {
        "name": "virtual card",
        "max_input_channels": 2,
        "max_output_channels": 2,
        "default_samplerate": 44_100.0,
    }
    if kind is None:
        return [card]
    if device and device not in card["name"]:
        raise ValueError(device)
    return card


def check_input_settings(device, channels, samplerate):
    if samplerate != 44_100:
        raise PortAudioError("Invalid sample rate")


check_output_settings = check_input_settings


class _Stream:
    def __init__(self, device, dtype, latency, samplerate, channels, callback, blocksize=512):
        if _broken():
            raise PortAudioError("Device unavailable")
        self.rate, self.channels, self.size, self.callback = samplerate, channels, blocksize, callback
        self.active = False

    def start(self):
        self.active = True
        threading.Thread(target=self._run, daemon=True).start()

    def close(self, ignore_errors=True):
        self.active = False

    def _run(self):
        begin, count = time.time(), 0
        while self.active:
            time.sleep(max(0.0, begin + (count + self.size) / self.rate - time.time()))
            if _broken():
                self.active = False
                return
            self.exchange(begin + count / self.rate, count)
            count += self.size


class InputStream(_Stream):
    def exchange(self, moment, count):
        tone = 0.1 * np.sin(2 * np.pi * 440 * (count + np.arange(self.size)) / self.rate)
        sound = np.repeat(tone[:, None], self.channels, axis=1).astype(np.float32)
        now = time.time()
        clock = SimpleNamespace(currentTime=now, inputBufferAdcTime=moment)
        self.callback(sound, self.size, clock, None)


class OutputStream(_Stream):
    def exchange(self, moment, count):
        sound = np.zeros((self.size, self.channels), np.float32)
        clock = SimpleNamespace(currentTime=time.time(), outputBufferDacTime=moment + LATENCY)
        self.callback(sound, self.size, clock, None)
        times = moment + LATENCY + np.arange(self.size) / self.rate
        with open(os.environ["PLAYED"], "ab") as file:
            file.write(np.column_stack([times, sound[:, 0]]).tobytes())
