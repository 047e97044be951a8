"""The part of the safety envelope that knows the robot's shape, and keeps its arms off the rest of it."""

import numpy as np

from gesture_bot.retarget.clearance import Clearance
from gesture_bot.retarget.robot import Robot

LEAST = 0.005
"""Least distance of forearms and hands from the rest of the robot [m]."""

ROUNDING = 1e-5
"""Distances waver by this where nothing moves [m]."""


class CollisionGuard:
    """Looks ahead: can all joints come to rest from where they are, as fast as they can, without a touch?

    As long as that is so for the state after each tick, braking always helps. What is too close from the
    start may not come closer.

    Args:
        robot: Whose arms.
        dt: Length of a tick [s].
    """

    def __init__(self, robot: Robot, dt: float):
        self._clearance = Clearance(robot)
        self._reaches = self._clearance.reaches()
        self._dt = dt
        self._gain = robot.limits.acceleration * dt
        self._allowed: dict[int, float] = {}

    def reset(self, positions: np.ndarray) -> None:
        """Start again from joints at (j,) positions [rad]."""
        self._allowed = self._clearance.under(positions, LEAST)

    def moved(self, positions: np.ndarray) -> None:
        """The joints are now at (j,) positions [rad]: what has come free stays so."""
        self._allowed = {
            pair: max(distance, self._allowed.get(pair, distance))
            for pair, distance in self._clearance.under(positions, LEAST).items()
        }

    def touching(self, positions: np.ndarray, velocities: np.ndarray) -> np.ndarray:
        """Which joints bring shapes too close to each other before they all have come to rest.

        The way is followed in steps that no shape can pass another in (conservative advancement: Mirtich
        1996, Impulse-based Dynamic Simulation, 2.3).

        Args:
            positions: (j,) [rad].
            velocities: (j,) [rad/s].

        Returns:
            (j,) mask; none if all keep clear.
        """
        path = self._braking(positions, velocities)
        travelled = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(path, axis=0)) @ self._reaches)])
        at = 0
        while at < len(path):
            left = travelled[-1] - travelled[at]
            close = self._clearance.under(path[at], LEAST + left + ROUNDING)
            bad = [pair for pair, d in close.items() if d < self._allowed.get(pair, LEAST) - ROUNDING]
            if bad:
                return np.any([self._clearance.joints(pair) for pair in bad], axis=0)
            if not close:
                break
            free = min(close.values()) - LEAST
            at = max(at + 1, int(np.searchsorted(travelled, travelled[at] + free)))
        return np.zeros(len(positions), bool)

    def _braking(self, positions: np.ndarray, velocities: np.ndarray) -> np.ndarray:
        """(n, j) positions at each tick until all joints are at rest [rad]."""
        ticks = np.arange(1 + np.ceil(np.max(np.abs(velocities) / self._gain, initial=0.0)))
        speeds = np.maximum(np.abs(velocities) - ticks[:, None] * self._gain, 0.0) * np.sign(velocities)
        moved = 0.5 * self._dt * np.cumsum(speeds[:-1] + speeds[1:], axis=0)
        return positions + np.concatenate([np.zeros((1, len(positions))), moved])
