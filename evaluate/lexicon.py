"""Diversity: the entropy of which gestures are used, over a lexicon of clusters (RG22, section 6)."""

from collections.abc import Sequence

import numpy as np
from scipy.cluster.vq import kmeans2, vq
from scipy.special import entr

from gesture_bot.base.frames import WINDOW
from gesture_bot.corpus.database import SEQUENCE, Database
from gesture_bot.evaluate.pieces import Piece
from gesture_bot.evaluate.resampling import Metric
from gesture_bot.evaluate.windows import parent_relative, sliding

LEXEMES = 50
"""Clusters; RG22 learns 50 to 100."""

_LOOKED_AT = 10_000  # windows that stand for a database


def lexicon(database: Database) -> np.ndarray:
    """(LEXEMES, d) the centres of clusters of a database's windows of 8 frames (k-means, fixed seed)."""
    begins = (database.starts[:, None] + np.arange(0, SEQUENCE, WINDOW)).ravel()
    begins = begins[:: -(-len(begins) // _LOOKED_AT)]
    windows = parent_relative(database.keypoints[begins[:, None] + np.arange(WINDOW)].astype(np.float64))
    windows = windows.reshape(len(windows), -1)
    return kmeans2(windows, min(LEXEMES, len(windows)), minit="++", seed=0)[0]


def lexemes(keypoints: np.ndarray, centres: np.ndarray) -> np.ndarray:
    """How often a motion (n, 17, 3) shows each lexeme: (LEXEMES,)."""
    windows = sliding(parent_relative(keypoints), WINDOW, WINDOW)
    used = vq(windows.reshape(len(windows), -1), centres)[0] if len(windows) else np.zeros(0, int)
    return np.bincount(used, minlength=len(centres))


def entropy(counts: np.ndarray) -> np.ndarray:
    """Of uses (..., LEXEMES) -> (...) [bit]: 0 for one gesture alone, log2 of how many for all alike."""
    return entr(counts / counts.sum(axis=-1, keepdims=True)).sum(axis=-1) / np.log(2)


def diversity(database: Database) -> Metric:
    """Entropy over the lexicon of a database."""
    centres = lexicon(database)

    def sums(pieces: Sequence[Piece]) -> np.ndarray:
        return np.array([lexemes(piece.shown, centres) for piece in pieces])

    return Metric("diversity", "bit", sums, entropy, 2, biased=True)
