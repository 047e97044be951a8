"""The voice inside the package: hibari-tts, one English voice, with the time of each word."""

import re
from difflib import SequenceMatcher
from pathlib import Path

import numpy as np
import soxr
from hibari import SAMPLE_RATE as HIBARI_RATE
from hibari import Hibari, dsp
from hibari import __version__ as hibari_version
from hibari.g2p.normalize import normalize
from hibari.voices import DEFAULT, voice_path

from gesture_bot.base.errors import GestureBotError, InvalidValueError
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.voice import Utterance, Word, bare

DURATIONS = "/Clip_output_0"
"""The tensor inside hibari's model that holds how many model frames each phoneme symbol lasts."""

LAG = 0.06
"""How far the durations run behind the sound at speed 1 [s].

Measured: the quietest moment of a stop between vowels lies this much before the middle of its symbol.
"""

SPEEDS = (0.5, 2.0)
"""Slowest and fastest speed of the model."""

_WORD = re.compile(r"\w+(?:[-'’.,:/@&]\w+)*")
_Span = tuple[int, int]


class EmbeddedVoice:
    """hibari's bundled voice. The same text gives the same samples."""

    def __init__(self) -> None:
        model = Path(voice_path(DEFAULT)).read_bytes() + _as_output(DURATIONS)
        try:
            self._hibari = Hibari(DEFAULT, model=model, threads=1)
        except Exception as error:  # onnxruntime's errors share no narrower base class
            raise GestureBotError(
                f"hibari-tts {hibari_version} gives no word times (no tensor {DURATIONS}); version 0.2.1 does"
            ) from error

    def speak(self, text: str, speed: float = 1.0) -> Utterance:
        """Speak English text, with the voice's own pause of about half a second between sentences.

        Words are those of the text as written. One that is read as several (2024) spans them all and is
        stressed where the first of them is; one that cannot be read (other scripts) is left out.

        Raises:
            InvalidValueError: The text holds nothing that can be spoken, or the speed is outside SPEEDS.
        """
        slowest, fastest = SPEEDS
        if not slowest <= speed <= fastest:
            raise InvalidValueError("speed is out of range", speed, [f"{slowest} to {fastest}"])
        parts: list[np.ndarray] = []
        words: list[Word] = []
        for sentence in self._hibari.split_sentences(text):
            symbols, spoken = self._phonemes(sentence)
            if spoken:
                start = sum(map(len, parts)) / SAMPLE_RATE
                samples, edges = self._synthesize(symbols, speed)
                parts.append(samples)
                for written, span in _match(sentence, spoken):
                    words.append(_timed(written, span, symbols, start + edges))
        if not words:
            raise InvalidValueError("the text holds nothing that can be spoken", text)
        return Utterance(np.concatenate(parts), tuple(words))

    def _phonemes(self, sentence: str) -> tuple[str, list[tuple[str, _Span]]]:
        """The phoneme symbols of a sentence, and its spoken words with the symbols that each spans."""
        g2p = self._hibari.g2p
        symbols = ""
        spoken = []
        for token in g2p.phonemize_tokens(g2p.tokenize(normalize(sentence))):
            sounds = "".join(c for c in token.phonemes or "" if c in self._hibari.vocab)
            if any(c.isalpha() for c in sounds):
                spoken.append((token.text, (len(symbols), len(symbols) + len(sounds))))
            if sounds:
                symbols += sounds + token.whitespace
        return symbols.rstrip(), spoken

    def _synthesize(self, symbols: str, speed: float) -> tuple[np.ndarray, np.ndarray]:
        """Samples at SAMPLE_RATE, and the (len(symbols) + 1,) moments between the symbols [s]."""
        inputs = {"ids": np.array([self._hibari.ids(symbols)]), "speed": np.array([speed], np.float32)}
        *spectrum, durations = self._hibari.sess.run(None, inputs)
        sound = dsp.synth(*(part[0] for part in spectrum), np.random.default_rng(0))
        frame = len(sound) / durations.sum() / HIBARI_RATE
        # The first and the last symbol of the model's input are padding around ours.
        edges = np.cumsum(durations[:-1], dtype=float) * frame - LAG / speed
        samples = soxr.resample(sound, HIBARI_RATE, SAMPLE_RATE)
        return np.clip(samples, -1, 1), edges


def _as_output(tensor: str) -> bytes:
    """The bytes that, appended to an ONNX model, make an inner tensor one more output.

    Protobuf merges messages that follow each other. This one is a ModelProto that holds only its graph
    (field 7), with only an output (field 12), with only a name (field 1); each is under 128 bytes long.
    """
    message = tensor.encode()
    for field in (1, 12, 7):
        message = bytes([field << 3 | 2, len(message)]) + message
    return message


def _match(sentence: str, spoken: list[tuple[str, _Span]]) -> list[tuple[str, _Span]]:
    """The words as written with the symbols that each spans.

    Written and spoken words are aligned like two versions of a text, since numbers and abbreviations are read
    as other words. Where their counts differ, the spoken ones are dealt out evenly.
    """
    written = _WORD.findall(sentence)
    said = [bare(text) for text, _ in spoken]
    alignment = SequenceMatcher(None, [bare(word) for word in written], said, autojunk=False)
    matched = []
    for _, first_written, last_written, first_spoken, last_spoken in alignment.get_opcodes():
        words, share = written[first_written:last_written], spoken[first_spoken:last_spoken]
        if not share:
            continue
        for i, word in enumerate(words):
            first = i * len(share) // len(words)
            last = max(first, (i + 1) * len(share) // len(words) - 1)
            matched.append((word, (share[first][1][0], share[last][1][1])))
    return matched


def _timed(text: str, span: _Span, symbols: str, edges: np.ndarray) -> Word:
    """A word with its times: the stress mark before the vowel lasts too, and sounds like the vowel."""
    first, last = span
    marks = [symbols.find(mark, first, last) for mark in "ˈˌ"]
    mark = next((i for i in marks if i >= 0), None)
    stress = edges[[first, last]] if mark is None else edges[[mark, min(mark + 2, last)]]
    return Word(text, float(edges[first]), float(edges[last]), float(stress.mean()))
