"""Do the hands move on the beats of the speech: PMB (RG22, section 6) and beat consistency."""

from collections.abc import Sequence

import numpy as np

from gesture_bot.base.frames import FRAME_RATE
from gesture_bot.evaluate.pieces import Piece
from gesture_bot.evaluate.resampling import Metric, ratio
from gesture_bot.evaluate.rhythm import matched
from gesture_bot.matching.rhythm import motion_beats

SIGMA = 0.1
"""Of beat consistency [s] (Liu et al. 2022, HA2G)."""


def pmb(within: float) -> Metric:
    """Share of the hands' beats within so many seconds of a beat of the speech; see rhythm.matched.

    Within RG22's 0.2 s, chance alone gives most: compare with mismatched motion. Where windows meet without
    being smoothed, their jump makes a beat of its own.
    """

    def sums(pieces: Sequence[Piece]) -> np.ndarray:
        return np.array([_matches(piece, within) for piece in pieces])

    def value(sums: np.ndarray) -> np.ndarray:
        return 100 * ratio(sums)

    return Metric(f"PMB {within:g} s", "%", sums, value, 1, "higher")


def consistency(moves: np.ndarray, beats: np.ndarray) -> np.ndarray:
    """Of each beat of a motion (m,) [s]: exp(-d^2 / 2 SIGMA^2), d being the way to the nearest of (b,) [s].

    Li et al. 2021 (AI Choreographer, section 5.2.1) score dance against music so.
    """
    if not len(beats):
        return np.zeros(len(moves))
    apart = np.abs(moves[:, None] - beats).min(axis=1)
    return np.exp(-(apart**2) / (2 * SIGMA**2))


def _matches(piece: Piece, within: float) -> tuple[float, float]:
    if piece.beats is None:
        return np.nan, np.nan
    moves = motion_beats(piece.shown) / FRAME_RATE
    return matched(moves, piece.beats, within), len(moves)


def _consistencies(pieces: Sequence[Piece]) -> np.ndarray:
    return np.array([_consistency(piece) for piece in pieces])


def _consistency(piece: Piece) -> tuple[float, float]:
    if piece.beats is None:
        return np.nan, np.nan
    moves = motion_beats(piece.shown) / FRAME_RATE
    return consistency(moves, piece.beats).sum(), len(moves)


BEAT_CONSISTENCY = Metric("beat consistency", "", _consistencies, ratio, 3, "higher")
