"""Is the motion as even where windows meet as inside them: acceleration and jerk of the wrists.

Kucherenko et al. 2019 (Analyzing Input and Output Representations, section 5) compare mean acceleration and
jerk with those of people. Windows of motion matching (MM22) do not join by themselves, so that both are told
apart here: where a difference reaches over a seam, and where it does not.
"""

from collections.abc import Sequence
from typing import Literal

import numpy as np

from gesture_bot.base.frames import FRAME_RATE
from gesture_bot.base.keypoints import WRISTS
from gesture_bot.evaluate.pieces import Piece
from gesture_bot.evaluate.resampling import Metric, ratio

Place = Literal["inside", "at seams"]


def derivative(keypoints: np.ndarray, order: int) -> np.ndarray:
    """Mean over both wrists of a derivative's length: (n, 17, 3) -> (n - order,) [m/s^order]."""
    change = np.diff(keypoints[:, WRISTS], n=order, axis=0) * FRAME_RATE**order
    return np.linalg.norm(change, axis=-1).mean(axis=-1)


def over_seams(seams: np.ndarray, frames: int, order: int) -> np.ndarray:
    """(frames - order,) bool: the differences that reach over a seam."""
    over = np.zeros(max(0, frames - order), bool)
    for seam in seams:
        over[max(0, seam - order) : seam] = True
    return over


def evenness(order: Literal[2, 3], place: Place) -> Metric:
    """Acceleration (2) or jerk (3), inside windows or where they meet."""

    def sums(pieces: Sequence[Piece]) -> np.ndarray:
        return np.array([_sums(piece, order, place) for piece in pieces])

    name = {2: "acceleration", 3: "jerk"}[order]
    return Metric(f"{name} {place}", f"m/s{order}", sums, ratio, 1)


def _sums(piece: Piece, order: int, place: Place) -> tuple[float, int]:
    values = derivative(piece.shown, order)
    over = over_seams(piece.seams, len(piece.shown), order)
    values = values[over == (place == "at seams")]
    return values.sum(), len(values)
