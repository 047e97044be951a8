"""The encoder of FGD: windows of motion to latent vectors, by NumPy alone. encoder_training.py trains it."""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from safetensors import SafetensorError, safe_open

from gesture_bot.base.errors import FileFormatError
from gesture_bot.base.files import config_dir
from gesture_bot.evaluate.frechet import half_distance, half_sums
from gesture_bot.evaluate.pieces import Piece
from gesture_bot.evaluate.resampling import Metric
from gesture_bot.evaluate.windows import STEP, WINDOW_FRAMES, parent_relative, sliding

LATENTS = 32
"""Numbers of a latent vector, as in Yoon et al. 2020."""

STRIDE = 2
"""Of each convolution."""

SLOPE = 0.2
"""Of the leaky ReLU below zero."""


class Encoder:
    """Convolutions over time, then a linear layer; see encoder_training.py.

    Args:
        path: The weights; the file of the package by default.

    Attributes:
        about: Where the weights come from: database, seed, steps, errors.

    Raises:
        FileFormatError: The file is missing, or is no encoder.
    """

    def __init__(self, path: Path | None = None) -> None:
        path = path or config_dir() / "models" / "gesture_encoder.safetensors"
        try:
            with safe_open(path, framework="numpy") as opened:
                arrays = {name: opened.get_tensor(name) for name in opened.keys()}  # noqa: SIM118
                self.about = json.loads((opened.metadata() or {})["about"])
            self._mean, self._deviation = arrays["mean"], arrays["deviation"]
            self._convolutions = [
                (arrays[f"convolutions.{layer}.weight"], arrays[f"convolutions.{layer}.bias"])
                for layer in range(self.about["layers"])
            ]
            self._linear = arrays["linear.weight"], arrays["linear.bias"]
        except (OSError, SafetensorError, KeyError) as error:
            raise FileFormatError(f"cannot read {path} as an encoder of gestures ({error})") from error

    def latents(self, keypoints: np.ndarray) -> np.ndarray:
        """Of each window of a motion: (n, 17, 3) -> (w, LATENTS), one every STEP frames."""
        motion = (parent_relative(keypoints) - self._mean) / self._deviation
        hidden = sliding(motion, WINDOW_FRAMES, STEP)
        if not len(hidden):
            return np.zeros((0, LATENTS))
        for weight, bias in self._convolutions:
            taps = np.lib.stride_tricks.sliding_window_view(hidden, weight.shape[2], axis=1)[:, ::STRIDE]
            hidden = np.tensordot(taps, weight, axes=([2, 3], [1, 2])) + bias
            hidden = np.where(hidden > 0, hidden, SLOPE * hidden)
        weight, bias = self._linear
        return hidden.reshape(len(hidden), -1) @ weight.T + bias


def fgd(encoder: Encoder) -> Metric:
    """FGD: the Frechet distance of the latents of windows (Yoon et al. 2020, section 5.1)."""

    def sums(pieces: Sequence[Piece]) -> np.ndarray:
        return half_sums(
            [encoder.latents(piece.shown) for piece in pieces],
            [encoder.latents(piece.recorded) for piece in pieces],
        )

    return Metric("FGD", "", sums, half_distance(LATENTS), 2, "lower", biased=True)
