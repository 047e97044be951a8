"""How much later than planned a motion is made."""

import numpy as np

SHIFTS = np.arange(-0.1, 0.5, 0.005)
"""Lags that are tried [s]."""

STILL = 0.05
"""Joints that are planned to move less than this tell nothing [rad]."""


def motion_lag(
    times: np.ndarray, positions: np.ndarray, planned_times: np.ndarray, planned: np.ndarray
) -> float | None:
    """The shift in time at which a measured motion is nearest to its plan, by least squares.

    Args:
        times: (n,) increasing moments [s].
        positions: (n, j) measured joint angles then [rad].
        planned_times: (m,) increasing moments that reach 0.5 s further to both sides [s].
        planned: (m, j) planned joint angles then [rad].

    Returns:
        The lag [s], within SHIFTS; None where no joint was to move.
    """
    inside = (planned_times >= times[0]) & (planned_times <= times[-1])
    moving = np.flatnonzero(np.ptp(planned[inside], axis=0) > STILL) if inside.any() else ()
    if not len(moving):
        return None
    errors = np.zeros(len(SHIFTS))
    for joint in moving:
        shifted = np.interp(times[None] - SHIFTS[:, None], planned_times, planned[:, joint])
        # An offset, as of a joint under load, is no lag.
        apart = shifted - positions[:, joint]
        errors += np.var(apart, axis=1)
    best = int(np.argmin(errors))
    if not 0 < best < len(SHIFTS) - 1:
        return float(SHIFTS[best])
    before, least, after = errors[best - 1 : best + 2]
    # Between the tried ones, the error is a parabola.
    step = (before - after) / (2 * (before - 2 * least + after))
    return float(SHIFTS[best] + step * (SHIFTS[1] - SHIFTS[0]))
