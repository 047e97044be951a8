"""English speech to text: the Moonshine model, which the wheel of moonshine-voice holds."""

from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from string import punctuation

import numpy as np
import onnxruntime

from gesture_bot.base.errors import FileFormatError
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.voice import bare

START, STOP = 1, 2
"""Tokens that begin and end every text; those below are no text."""

SPACE = "▁"
"""Begins a token that begins a word."""

TOKENS_A_SECOND = 6.5
"""No more can be said; the model may repeat itself for ever."""

SHORTEST = 0.3
"""Less sound holds no word [s]."""


@dataclass(frozen=True)
class Transcribed:
    """A word of a transcript.

    Attributes:
        text: In lower case, without punctuation.
        confidence: Probability of its least likely token, given all before.
    """

    text: str
    confidence: float


class Transcriber:
    """Moonshine tiny (Jeffries and others 2024, arXiv:2410.15608), decoded greedily on one thread.

    Its encoder takes sound of any length, so that a short piece costs little: 3 s take about 80 ms.

    Raises:
        FileFormatError: moonshine-voice is not installed, or not the version that holds the model.
    """

    def __init__(self) -> None:
        spec = find_spec("moonshine_voice")  # not imported: that would load its own runtime
        package = Path(spec.origin).parent if spec and spec.origin else Path("moonshine_voice")
        folder = package / "assets" / "tiny-en"
        if not folder.is_dir():
            raise FileFormatError("moonshine-voice 0.1.0 is not installed; there is no", folder)
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        self._encoder, self._decoder = (
            onnxruntime.InferenceSession(str(folder / name), options)
            for name in ("encoder_model.ort", "decoder_model_merged.ort")
        )
        self._tokens = _tokens((folder / "tokenizer.bin").read_bytes())
        self._nothing = {
            one.name: np.zeros((0, one.shape[1], 1, one.shape[3]), np.float32)
            for one in self._decoder.get_inputs()
            if one.name.startswith("past_key_values")
        }

    def transcribe(self, samples: np.ndarray) -> list[Transcribed]:
        """The words in sound.

        Args:
            samples: (n,) float32, mono, at SAMPLE_RATE, full scale 1.
        """
        if len(samples) < SHORTEST * SAMPLE_RATE:
            return []
        words: list[tuple[str, float]] = []
        for token, confidence in self._decode(samples[None]):
            if token.startswith(SPACE) or not words:
                words.append(("", 1.0))
            if bare(token):  # how sure the punctuation is does not matter
                words[-1] = words[-1][0] + token.strip(SPACE), min(words[-1][1], confidence)
        return [Transcribed(text.strip(punctuation).lower(), sure) for text, sure in words if text]

    def _decode(self, samples: np.ndarray) -> list[tuple[str, float]]:
        """The tokens of a text and their probabilities."""
        mask = np.ones(samples.shape, np.int64)
        (states,) = self._encoder.run(None, {"input_values": samples, "attention_mask": mask})
        found: list[tuple[str, float]] = []
        past, token = self._nothing, START
        for step in range(round(TOKENS_A_SECOND * samples.shape[1] / SAMPLE_RATE)):
            logits, *present = self._decoder.run(
                None,
                {
                    "input_ids": np.array([[token]]),
                    "encoder_hidden_states": states,
                    "encoder_attention_mask": mask,
                    "use_cache_branch": np.array([step > 0]),
                    **past,
                },
            )
            # What the encoder's states are to the decoder is computed once.
            past = {
                name: past[name] if step and ".encoder." in name else new
                for name, new in zip(past, present, strict=True)
            }
            token = int(logits[0, -1].argmax())
            if token == STOP:
                break
            likelihood = np.exp(logits[0, -1] - logits[0, -1, token])
            if token > STOP:
                found.append((self._tokens[token], float(1 / likelihood.sum())))
        return found


def _tokens(data: bytes) -> list[str]:
    """Texts of the tokens: each a length, in seven bits or twice seven, and so many bytes."""
    texts = []
    at = 0
    while at < len(data):
        length = data[at]
        at += 1
        if length >= 128:
            length += 128 * (data[at] - 1)
            at += 1
        texts.append(data[at : at + length].decode(errors="replace"))
        at += length
    return texts
