"""Joint trajectories without ROS: the plain form of trajectory_msgs/JointTrajectory."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicHermiteSpline


@dataclass(frozen=True)
class JointTrajectory:
    """Stamped joint positions and velocities. It replaces all that was planned from its first point on.

    Attributes:
        joints: The j joint names.
        times: (n,) increasing moments [s since the epoch].
        positions: (n, j) [rad].
        velocities: (n, j) [rad/s].
    """

    joints: tuple[str, ...]
    times: np.ndarray
    positions: np.ndarray
    velocities: np.ndarray

    def at(self, seconds: float | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions and velocities at one moment or several.

        Cubic between points, as joint_trajectory_controller interpolates them; still before the first point
        and after the last one.

        Returns:
            (..., j) positions [rad] and (..., j) velocities [rad/s].
        """
        inside = np.clip(seconds, self.times[0], self.times[-1])
        if len(self.times) == 1:
            positions = np.broadcast_to(self.positions[0], (*np.shape(seconds), len(self.joints)))
            return positions.copy(), np.zeros_like(positions)
        # Times since the epoch lose digits in the cubic's coefficients: they count from the first point.
        since = inside - self.times[0]
        outside = np.asarray(inside != seconds)[..., None]
        return self._spline(since), np.where(outside, 0.0, self._spline(since, 1))

    @cached_property
    def _spline(self) -> CubicHermiteSpline:
        return CubicHermiteSpline(self.times - self.times[0], self.positions, self.velocities)
