"""Paths made of minimum-jerk submovements, and the slow sway of a body that stands still."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Submovement:
    """One reach from wherever the path aims to a new goal.

    Attributes:
        start, end: Moments at which it begins and ends [s].
        goal: (d,) the state reached.
        bow: (d,) how far the path bends aside half-way.
        curl: (d,) how far it swings to this side in its first half and to the other in its second; with a bow
            across it, the path is a loop.
    """

    start: float
    end: float
    goal: np.ndarray
    bow: np.ndarray | float = 0.0
    curl: np.ndarray | float = 0.0


def path(times: np.ndarray, origin: np.ndarray, submovements: Sequence[Submovement]) -> np.ndarray:
    """States at the given times: submovements that overlap add up (Flash and Henis 1991).

    Args:
        times: (n,) moments [s].
        origin: (d,) the state before the first submovement.
        submovements: In the order in which they follow one another.

    Returns:
        (n, d) states, with continuous acceleration.
    """
    states = np.tile(origin, (len(times), 1))
    aim = origin
    for movement in submovements:
        done = minimum_jerk((times - movement.start) / (movement.end - movement.start))[:, None]
        turn = 2 * np.pi * done
        states += done * (movement.goal - aim)
        states += (1 - np.cos(turn)) / 2 * movement.bow + np.sin(turn) / 2 * movement.curl
        aim = movement.goal
    return states


def minimum_jerk(x: np.ndarray) -> np.ndarray:
    """From 0 to 1 as x goes from 0 to 1 (Flash and Hogan 1985), resting outside."""
    x = np.clip(x, 0.0, 1.0)
    return x**3 * (10 - 15 * x + 6 * x**2)


PEAK = 1.875
"""Peak speed of a minimum-jerk movement over its mean speed."""


def sway(times: np.ndarray, amplitude: np.ndarray, generator: np.random.Generator) -> np.ndarray:
    """Slow aimless motion, 0.1 to 0.5 Hz, at most as wide as the amplitude: (n,), (d,) -> (n, d)."""
    waves = 3
    rate = generator.uniform(0.1, 0.5, (waves, 1, len(amplitude)))
    phase = generator.uniform(0, 2 * np.pi, rate.shape)
    return amplitude * np.sin(2 * np.pi * rate * times[:, None] + phase).mean(axis=0)
