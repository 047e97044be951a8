"""Another voice than the database's: its features brought to those of the database's voice."""

import numpy as np

from gesture_bot.corpus.database import Database
from gesture_bot.speech.features import COEFFICIENTS, FLOOR, STATIC
from gesture_bot.speech.loudness import SPEECH_LEVEL

LEAST_SPEECH = SPEECH_LEVEL - 25.0
"""Speech has an energy over this [dB]: features are those of normalised sound."""

PRIOR = 75
"""A speaker is like the database's for so many frames of speech that were not heard (5 s)."""

MEMORY = 900
"""Speech over which a speaker is averaged [frames] (60 s): loud and soft passages stay apart."""

MOST_STRETCHED = 2.0
"""Deviations are brought to those of the database by no more than this factor, or its inverse."""

FARTHEST = 10.0
"""A frame counts as no further than this from the database's mean [its deviations]."""


class Speaker:
    """Running mean and variance of a speaker's features over speech (Viikki and Laurila 1998).

    They start from those of the database's speech. A frame then lies where it would lie in the database's
    voice, the closer to silence, the less: digital silence stays as it is.

    Args:
        mean, deviation: (STATIC,) of the database's speech; see speech_statistics.
    """

    def __init__(self, mean: np.ndarray, deviation: np.ndarray) -> None:
        self._target, self._deviation = mean, deviation
        self._mean, self._variance = mean, deviation**2
        self._weight = PRIOR

    def push(self, features: np.ndarray, speech: bool) -> np.ndarray:
        """Take in the next frame.

        Args:
            features: (28,) speech features.
            speech: Whether somebody speaks in it.

        Returns:
            (28,) float32, in terms of the database.
        """
        static = features[:STATIC].astype(np.float64)
        if speech and static[COEFFICIENTS] > LEAST_SPEECH:
            self._weight = min(self._weight + 1, MEMORY)
            limit = FARTHEST * self._deviation
            counted = np.clip(static, self._target - limit, self._target + limit)
            before = counted - self._mean
            self._mean = self._mean + before / self._weight
            change = before * (counted - self._mean) - self._variance
            self._variance = self._variance + change / self._weight
        stretch = self._deviation / np.sqrt(np.maximum(self._variance, 1e-12))
        stretch = np.clip(stretch, 1 / MOST_STRETCHED, MOST_STRETCHED)
        theirs = self._target + stretch * (static - self._mean)
        loud = np.clip((static[COEFFICIENTS] - FLOOR) / (LEAST_SPEECH - FLOOR), 0, 1)
        derivative = features[STATIC:] * (1 + loud * (stretch - 1))
        return np.concatenate([static + loud * (theirs - static), derivative]).astype(np.float32)


def is_loud(features: np.ndarray) -> np.ndarray:
    """Whether frames are loud enough to be speech: (n, 28) -> (n,) bool; all, where none is."""
    loud = features[:, COEFFICIENTS] > LEAST_SPEECH
    return loud if loud.any() else np.ones(len(features), bool)


def speech_statistics(database: Database) -> tuple[np.ndarray, np.ndarray]:
    """(STATIC,) mean and (STATIC,) deviation of a database's features over its frames of speech."""
    static = database.features[is_loud(database.features), :STATIC].astype(np.float64)
    deviation = static.std(axis=0)
    return static.mean(axis=0), np.where(deviation > 0, deviation, 1.0)
