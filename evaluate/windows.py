"""Windows of motion, and the numbers that metrics of whole distributions take from them."""

import numpy as np

from gesture_bot.base.keypoints import BONES, KEYPOINTS, bone_vectors

WINDOW_FRAMES = 32
"""Frames of a window (Yoon et al. 2020: 34)."""

STEP = 4
"""Frames from one window to the next."""

_UPPER = [not KEYPOINTS[child].endswith("hip") for _, child in BONES]

CHANNELS = 3 * sum(_UPPER)
"""Numbers of a frame."""


def parent_relative(keypoints: np.ndarray) -> np.ndarray:
    """Bones of the upper body as vectors from the parent: (..., 17, 3) -> (..., CHANNELS) [m]."""
    return bone_vectors(keypoints)[..., _UPPER, :].reshape(*keypoints.shape[:-2], CHANNELS)


def sliding(values: np.ndarray, frames: int, step: int) -> np.ndarray:
    """Windows of a motion: (n, ...) -> (w, frames, ...), one every `step` frames; none in a short motion."""
    begins = np.arange(0, len(values) - frames + 1, step)
    return values[begins[:, None] + np.arange(frames)]
