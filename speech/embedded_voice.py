"""The voice inside the package: hibari-tts, one English voice, with the time of each word."""

import logging
from pathlib import Path

import numpy as np
import soxr
from hibari import SAMPLE_RATE as HIBARI_RATE
from hibari import Hibari, dsp
from hibari import __version__ as hibari_version
from hibari.voices import DEFAULT, voice_path

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.speech.alignment import align
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.loudness import amplified
from gesture_bot.speech.pronunciation import Span, read, sentences
from gesture_bot.speech.prosody import repitched, stretched
from gesture_bot.speech.voice import PLAIN, Manner, Utterance, Word

DURATIONS = "/Clip_output_0"
"""The tensor inside hibari's model that holds how many model frames each phoneme symbol lasts."""

LAG = 0.06
"""How far the durations run behind the sound at speed 1 [s].

Measured: the quietest moment of a stop between vowels lies this much before the middle of its symbol.
"""


class EmbeddedVoice:
    """hibari's bundled voice. The same text in the same manner gives the same samples."""

    def __init__(self) -> None:
        model = Path(voice_path(DEFAULT)).read_bytes()
        self._times = True
        try:
            self._hibari = Hibari(DEFAULT, model=model + _as_output(DURATIONS), threads=1)
        except Exception:  # onnxruntime's errors share no narrower base class
            self._hibari = Hibari(DEFAULT, model=model, threads=1)
            self._times = False
            logging.getLogger(__name__).warning(
                "hibari-tts %s gives no word times (no tensor %s; version 0.2.1 does); alignment finds them",
                hibari_version,
                DURATIONS,
            )

    def speak(self, text: str, manner: Manner = PLAIN) -> Utterance:
        """Speak English text, with the voice's own pause of about half a second between sentences.

        Words are those of the text as written. One that is read as several (2024) spans them all and is
        stressed where the first of them is; one that cannot be read (other scripts) is left out.

        Raises:
            InvalidValueError: The text holds nothing that can be spoken.
        """
        parts: list[np.ndarray] = []
        words: list[Word] = []
        for sentence in sentences(text):
            symbols, spoken = read(sentence)
            if spoken:
                start = sum(map(len, parts)) / SAMPLE_RATE
                samples, edges = self._synthesize(symbols, manner)
                parts.append(samples)
                words += (_timed(word, span, symbols, start + edges) for word, span in spoken)
        if not parts:
            raise InvalidValueError("the text holds nothing that can be spoken", text)
        samples = np.concatenate(parts)
        return Utterance(samples, tuple(words) if self._times else align(samples, text))

    def _synthesize(self, symbols: str, manner: Manner) -> tuple[np.ndarray, np.ndarray]:
        """Samples at SAMPLE_RATE, and the (len(symbols) + 1,) moments between the symbols [s].

        All moments are 0 where the model does not give them.
        """
        inputs = {"ids": np.array([self._hibari.ids(symbols)]), "speed": np.ones(1, np.float32)}
        outputs = self._hibari.sess.run(None, inputs)
        spectrum = [part[0] for part in outputs[:6]]
        if manner.speed != 1:
            spectrum = stretched(spectrum, manner.speed)
        if manner.pitch != 1:
            spectrum = repitched(spectrum, manner.pitch)
        sound = dsp.synth(*spectrum, np.random.default_rng(0))
        samples = amplified(soxr.resample(sound, HIBARI_RATE, SAMPLE_RATE), manner.energy)
        if not self._times:
            return samples, np.zeros(len(symbols) + 1)
        durations = outputs[6]
        frame = len(sound) / durations.sum() / HIBARI_RATE
        # The first and the last symbol of the model's input are padding around ours.
        return samples, np.cumsum(durations[:-1], dtype=float) * frame - LAG / manner.speed


def _as_output(tensor: str) -> bytes:
    """The bytes that, appended to an ONNX model, make an inner tensor one more output.

    Protobuf merges messages that follow each other. This one is a ModelProto that holds only its graph
    (field 7), with only an output (field 12), with only a name (field 1); each is under 128 bytes long.
    """
    message = tensor.encode()
    for field in (1, 12, 7):
        message = bytes([field << 3 | 2, len(message)]) + message
    return message


def _timed(text: str, span: Span, symbols: str, edges: np.ndarray) -> Word:
    """A word with its times: the stress mark before the vowel lasts too, and sounds like the vowel."""
    first, last = span
    marks = [symbols.find(mark, first, last) for mark in "ˈˌ"]
    mark = next((i for i in marks if i >= 0), None)
    stress = edges[[first, last]] if mark is None else edges[[mark, min(mark + 2, last)]]
    return Word(text, float(edges[first]), float(edges[last]), float(stress.mean()))
