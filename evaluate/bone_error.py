"""Do limbs keep their length: a network that gives out keypoints (MM22, section 4) may stretch them."""

from collections.abc import Sequence

import numpy as np

from gesture_bot.base.keypoints import bone_lengths
from gesture_bot.corpus.one_body import STANDARD_LENGTHS
from gesture_bot.evaluate.pieces import Piece
from gesture_bot.evaluate.resampling import Metric, ratio


def bone_errors(keypoints: np.ndarray) -> np.ndarray:
    """Mean absolute error of the bones, against the body of all databases: (n, 17, 3) -> (n,) [mm]."""
    return 1000 * np.abs(bone_lengths(keypoints) - STANDARD_LENGTHS).mean(axis=-1)


def _sums(pieces: Sequence[Piece]) -> np.ndarray:
    return np.array([(bone_errors(piece.shown).sum(), len(piece.shown)) for piece in pieces])


BONE_ERROR = Metric("bone error", "mm", _sums, ratio, 2, "lower")
