"""How a difference between two motions dies away: the inertialization of Bollo (GDC 2018)."""

import numpy as np


def faded(
    position: np.ndarray, velocity: np.ndarray, elapsed: np.ndarray, half_life: float | np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """A difference some time after it arose, as a critically damped spring draws it to zero.

    Args:
        position: Difference of the positions when it arose, in any unit.
        velocity: Difference of the velocities then, in that unit by a unit of time.
        elapsed: Time since then.
        half_life: About the time in which half of it is gone (the half-life of Holden's springs).

    Returns:
        What is left of the positions' difference and of the velocities'.
    """
    damping = 2 * np.log(2) / half_life
    slope = velocity + damping * position
    decay = np.exp(-damping * elapsed)
    return decay * (position + slope * elapsed), decay * (velocity - damping * slope * elapsed)
