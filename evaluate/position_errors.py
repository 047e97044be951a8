"""How far a motion is from the speaker's own: MAJE and MAD (Yoon et al. 2020, section 5; RG22, section 6)."""

from collections.abc import Sequence

import numpy as np

from gesture_bot.base.frames import FRAME_RATE
from gesture_bot.base.keypoints import KEYPOINTS
from gesture_bot.evaluate.pieces import Piece
from gesture_bot.evaluate.resampling import Metric, ratio

UPPER = [place for place, name in enumerate(KEYPOINTS) if name != "pelvis" and not name.endswith("hip")]
"""The 14 keypoints of the upper body that move, by index."""


def joint_errors(shown: np.ndarray, recorded: np.ndarray) -> np.ndarray:
    """MAJE of each frame: mean absolute error of the coordinates, (n, 17, 3) twice -> (n,) [mm]."""
    return 1000 * np.abs(shown - recorded)[:, UPPER].mean(axis=(1, 2))


def acceleration_errors(shown: np.ndarray, recorded: np.ndarray) -> np.ndarray:
    """MAD of each frame: mean length of the difference of accelerations, -> (n - 2,) [mm/s2]."""
    apart = np.diff((shown - recorded)[:, UPPER], n=2, axis=0) * FRAME_RATE**2
    return 1000 * np.linalg.norm(apart, axis=-1).mean(axis=-1)


def _sums(errors: np.ndarray) -> tuple[float, int]:
    return errors.sum(), len(errors)


def _maje(pieces: Sequence[Piece]) -> np.ndarray:
    return np.array([_sums(joint_errors(piece.shown, piece.recorded)) for piece in pieces])


def _mad(pieces: Sequence[Piece]) -> np.ndarray:
    return np.array([_sums(acceleration_errors(piece.shown, piece.recorded)) for piece in pieces])


MAJE = Metric("MAJE", "mm", _maje, ratio, 1, "lower")
MAD = Metric("MAD", "mm/s2", _mad, ratio, 0, "lower")
