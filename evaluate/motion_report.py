"""What a recorded joint motion was like: did it stay in its limits, was it even, when were its strokes."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d
from scipy.signal import find_peaks

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.retarget.follower import JointLimits
from gesture_bot.servo.present import STAMP_ERROR

TICK = 2 * np.pi / 4096
"""Resolution of a Dynamixel X-series servo's position [rad] (Present Position: 0.088 degrees a unit)."""

_VELOCITY_SPAN = 0.04
"""Velocities are taken over at least this long [s], so that a tick of the servo does not look like a dash."""

_GRID, _SMOOTHING = 0.01, 0.04
"""Strokes are looked for on a grid of 10 ms, in a speed that is smoothed by a Gaussian of 40 ms."""

_STILL = 0.05
"""A wrist that is never faster makes no stroke [m/s]."""


@dataclass(frozen=True)
class MotionReport:
    """Figures of merit of a joint motion.

    Attributes:
        limit_violations: Samples of a joint outside its position limits by more than a tick.
        joint_jumps: Changes of a joint from one sample to the next that its velocity limit does not allow
            in the time between them and 4 ms (the error of the stamps), by more than two ticks (the
            rounding of both samples).
        max_velocity_rad_s: Fastest any joint moved, over at least 40 ms [rad/s].
        mean_rate_hz: Samples a second.
        longest_gap_s: Longest time between two samples [s].
    """

    limit_violations: int
    joint_jumps: int
    max_velocity_rad_s: float
    mean_rate_hz: float
    longest_gap_s: float


@dataclass(frozen=True)
class Latency:
    """How long something took [ms]: the median, and what 99 in 100 stay below."""

    median: float
    p99: float


def motion_report(
    joints: Sequence[str], times: np.ndarray, positions: np.ndarray, limits: JointLimits
) -> MotionReport:
    """Judge a joint motion.

    Args:
        joints: The j joint names.
        times: (n,) increasing moments [s], n > 1.
        positions: (n, j) joint angles [rad].
        limits: What the joints may do.

    Raises:
        InvalidValueError: A joint has no limits, there are fewer than two samples, the times do not
            increase, or a number is not finite.
    """
    for joint in joints:
        if joint not in limits.joints:
            raise InvalidValueError("no limits for this joint", joint, limits.joints)
    if len(times) < 2 or not (np.diff(times) > 0).all():
        raise InvalidValueError("a motion needs two samples or more, at increasing times")
    if not np.isfinite(positions).all():
        raise InvalidValueError("a joint angle is not finite")
    columns = [limits.joints.index(joint) for joint in joints]
    lower, upper, velocity = limits.lower[columns], limits.upper[columns], limits.velocity[columns]
    gaps = np.diff(times)
    outside = np.maximum(lower - positions, positions - upper) > TICK
    jumps = np.abs(np.diff(positions, axis=0)) > velocity * (gaps[:, None] + STAMP_ERROR) + 2 * TICK
    return MotionReport(
        limit_violations=int(outside.sum()),
        joint_jumps=int(jumps.sum()),
        max_velocity_rad_s=_max_velocity(times, positions),
        mean_rate_hz=float(1 / gaps.mean()),
        longest_gap_s=float(gaps.max()),
    )


def _max_velocity(times: np.ndarray, positions: np.ndarray) -> float:
    later = np.searchsorted(times, times + _VELOCITY_SPAN)
    first = np.flatnonzero(later < len(times))
    later = later[first]
    moved = np.abs(positions[later] - positions[first]).max(axis=1)
    return float((moved / (times[later] - times[first])).max(initial=0))


def latency_ms(seconds: Sequence[float]) -> Latency | None:
    """Sum up how long something took each time [s]; None if it never happened."""
    if not len(seconds):
        return None
    median, p99 = np.percentile(seconds, [50, 99])
    return Latency(float(1000 * median), float(1000 * p99))


def stroke_time(times: np.ndarray, wrist: np.ndarray, near: float, within: float = 0.5) -> float | None:
    """When a stroke ended: the wrist, after a fast phase, is at its apex.

    A fast phase is a peak of the wrist's speed, smoothed over 40 ms, above 5 cm/s, that stands out by a
    fifth of the largest speed around. It ends where the speed next has a minimum or falls below a tenth of
    that peak, whichever comes first. Of all fast phases, the one whose end is closest to `near` counts.

    Args:
        times: (n,) increasing moments [s].
        wrist: (n, 3) positions of the wrist [m].
        near: Moment of the word [s].
        within: Largest distance from `near` [s].

    Returns:
        The moment [s], or None when no fast phase ends within reach or the motion is not there.
    """
    clear = within + 1.0  # the fast phase begins before its end, and speeds around it tell what is fast
    grid = np.arange(max(-clear, times[0] - near), min(clear, times[-1] - near), _GRID)
    around = np.abs(times - near) < clear + 0.5
    if around.sum() < 4 or len(grid) < 4:
        return None
    velocity = CubicSpline(times[around] - near, wrist[around])(grid, 1)
    speed = np.linalg.norm(gaussian_filter1d(velocity, _SMOOTHING / _GRID, axis=0), axis=1)
    prominence = 0.2 * speed.max()
    peaks, _ = find_peaks(speed, height=_STILL, prominence=prominence)
    minima, _ = find_peaks(-speed, prominence=prominence)
    ends = []
    for peak in peaks:
        slow = peak + np.flatnonzero(speed[peak:] < 0.1 * speed[peak])
        candidates = [*slow[:1], *minima[minima > peak][:1]]
        if candidates:
            ends.append(min(candidates))
    moments = grid[ends]
    moments = moments[np.abs(moments) <= within]
    return float(near + moments[np.argmin(np.abs(moments))]) if len(moments) else None
