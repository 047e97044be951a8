"""Controls for the training: bounds that the speaker's own motion keeps, so that what is real keeps them."""

import numpy as np

from gesture_bot.base.frames import WINDOW
from gesture_bot.refine.bounds import BOUNDS

LENGTHS = 4, 20
"""Windows of 8 frames from one change of the bounds to the next."""

COUNTS = (0, 1, 1, 2)
"""How many bounds there are at once, drawn evenly."""

EXCEPTED = 5
"""Percentile of the motion's own frames that may miss a bound."""

EXTREME = 3
"""How much rather a bound is drawn that few other frames keep."""


def hindsight(measured: np.ndarray, ranked: np.ndarray, generator: np.random.Generator) -> np.ndarray:
    """Bounds for a motion, which change from time to time.

    Args:
        measured: (n, 8) its numbers; see bounds.MEASURED.
        ranked: (m, 8) those of all motion, each sorted.
        generator: Of every draw.

    Returns:
        (n, 16) thresholds, NaN where there is none; see bounds.bounds_of.
    """
    bounds = np.full((len(measured), BOUNDS), np.nan)
    begin = 0
    while begin < len(measured):
        stop = begin + WINDOW * int(generator.integers(LENGTHS[0], LENGTHS[1] + 1))
        least, most = np.percentile(measured[begin:stop], [EXCEPTED, 100 - EXCEPTED], axis=0)
        missing = np.array(
            [np.searchsorted(numbers, value) for numbers, value in zip(ranked.T, least, strict=True)]
            + [
                len(numbers) - np.searchsorted(numbers, value)
                for numbers, value in zip(ranked.T, most, strict=True)
            ]
        )
        weights = (missing / len(ranked)) ** EXTREME + 1e-9
        drawn = generator.choice(BOUNDS, generator.choice(COUNTS), replace=False, p=weights / weights.sum())
        bounds[begin:stop, drawn] = np.concatenate([least, most])[drawn]
        begin = stop
    return bounds
