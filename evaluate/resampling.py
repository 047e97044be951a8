"""Metrics with 95% intervals: the bootstrap over pieces of speech (Efron and Tibshirani 1993, chapter 13)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from gesture_bot.evaluate.pieces import Piece

RESAMPLES = 500
"""Draws of as many pieces as there are, with replacement."""

_COVERED = (2.5, 97.5)


@dataclass(frozen=True)
class Metric:
    """A figure of merit, which is a function of sums over pieces: drawing pieces anew is adding them up anew.

    Attributes:
        name: In tables.
        unit: In tables; empty for a number without one.
        sums: From p pieces to (p, d) numbers; NaN where a piece lacks what is measured.
        value: From sums of them (..., d) to (...); NaN where nothing was measured.
        decimals: Worth printing.
        better: `lower`, `higher`, or empty where the best is what people do.
        biased: Whether fewer different pieces move it one way; see estimate.
    """

    name: str
    unit: str
    sums: Callable[[Sequence[Piece]], np.ndarray]
    value: Callable[[np.ndarray], np.ndarray]
    decimals: int
    better: str = ""
    biased: bool = False


def ratio(sums: np.ndarray) -> np.ndarray:
    """A mean from sums (..., 2): total and count; NaN without any."""
    total, count = np.moveaxis(sums, -1, 0)
    return np.divide(total, count, out=np.full(np.shape(total), np.nan), where=count > 0)


@dataclass(frozen=True)
class Estimate:
    """A figure and what draws of pieces make of it.

    Attributes:
        value: From all pieces.
        draws: (RESAMPLES,) from drawn ones. The same draw holds the same pieces for every system.
    """

    value: float
    draws: np.ndarray

    @property
    def interval(self) -> tuple[float, float]:
        """From where to where 95% of the draws lie."""
        low, high = np.percentile(self.draws, _COVERED)
        return float(low), float(high)

    def minus(self, other: "Estimate") -> "Estimate":
        """The difference of two systems, draw by draw: what both owe to the same pieces falls out."""
        return Estimate(self.value - other.value, self.draws - other.draws)


def estimate(metric: Metric, pieces: Sequence[Piece], seed: int = 0) -> Estimate:
    """A metric of pieces, with draws.

    The pieces at even and at odd places are drawn by themselves: they are the two halves of frechet.py. A
    Frechet distance or an entropy of fewer different pieces is biased, upward or downward. Drawing brings in
    that bias a second time; it is taken out by a factor that makes the mean of the draws the value.
    """
    sums = metric.sums(pieces)
    generator = np.random.default_rng(seed)
    times = np.zeros((RESAMPLES, len(pieces)))
    for half in (slice(0, None, 2), slice(1, None, 2)):
        count = len(range(len(pieces))[half])
        times[:, half] = generator.multinomial(count, np.full(count, 1 / count), RESAMPLES)
    value, draws = float(metric.value(sums.sum(axis=0))), metric.value(times @ sums)
    return Estimate(value, draws * (value / draws.mean()) if metric.biased else draws)
