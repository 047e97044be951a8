"""The part of the safety envelope that knows the robot's shape, and keeps its arms off the rest of it."""

import numpy as np

from gesture_bot.retarget.clearance import Clearance
from gesture_bot.retarget.robot import Robot

LEAST = 0.005
"""Least distance of forearms and hands from the rest of the robot [m]."""

FAR = 0.3
"""Distances over this are not told apart [m]."""

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
        self.reset(robot.rest)

    def reset(self, positions: np.ndarray) -> None:
        """Start again from joints at (j,) positions [rad]."""
        self._allowed = self._clearance.under(positions, LEAST)
        # Distances of all pairs are at least these, at these positions.
        self._known = np.full(len(self._reaches), -np.inf)
        self._known_at = positions.copy()

    def moved(self, positions: np.ndarray, surely: bool) -> None:
        """The joints are now at (j,) positions [rad]: what has come free stays so.

        If they keep clear not `surely`, as when a servo was found elsewhere than it was sent, what is too
        close may not come closer.
        """
        if self._allowed or not surely:
            before, self._allowed = self._allowed, self._clearance.under(positions, LEAST)
            for pair, distance in self._allowed.items():
                allowed = before.get(pair, LEAST)
                if distance > allowed - 2 * ROUNDING:
                    self._allowed[pair] = max(distance, allowed)

    def touching(self, positions: np.ndarray, velocities: np.ndarray) -> list[np.ndarray]:
        """Which joints bring two shapes too close to each other before all have come to rest.

        The way is followed in steps in which no shape can reach another (conservative advancement: Mirtich
        1996, Impulse-based Dynamic Simulation, 2.3).

        Args:
            positions: (j,) [rad].
            velocities: (j,) [rad/s].

        Returns:
            (j,) masks of the joints on either side that could brake; empty if all keep clear.
        """
        self._known -= self._reaches @ np.abs(positions - self._known_at)
        self._known_at = positions
        # Mostly nothing is near: no joint goes farther than this until it rests.
        speeds = np.abs(velocities)
        farthest = 0.5 * self._dt * speeds * (speeds / self._gain + 1.0)
        if (self._known > LEAST + self._reaches @ farthest).all():
            return []
        path = self._braking(positions, velocities)
        steps = np.abs(np.diff(path, axis=0, prepend=path[:1]))
        ways = np.cumsum(steps, axis=0) @ self._reaches.T
        # The tick at which each pair has to be looked at next; the last is never reached.
        due = np.where(self._known < LEAST + ways[-1], 0, len(path))
        while (at := int(due.min(initial=len(path)))) < len(path):
            self._clearance.place(path[at])
            pairs = np.flatnonzero(due == at)
            distances = self._clearance.gaps(pairs)
            for i in np.flatnonzero(distances < LEAST + ways[-1, pairs] - ways[at, pairs]):
                pair = int(pairs[i])
                distances[i] = self._clearance.distance(pair, FAR)
                if distances[i] < self._allowed.get(pair, LEAST) - ROUNDING:
                    return self._clearance.sides(pair)
            if at == 0:
                self._known[pairs] = distances
            reached = ways[:, pairs] < ways[at, pairs] + distances - LEAST
            due[pairs] = np.maximum(reached.sum(axis=0), at + 1)
        return []

    def _braking(self, positions: np.ndarray, velocities: np.ndarray) -> np.ndarray:
        """(n, j) positions at each tick until all joints are at rest [rad]."""
        ticks = np.arange(1 + np.ceil(np.max(np.abs(velocities) / self._gain, initial=0.0)))
        speeds = np.maximum(np.abs(velocities) - ticks[:, None] * self._gain, 0.0) * np.sign(velocities)
        moved = 0.5 * self._dt * np.cumsum(speeds[:-1] + speeds[1:], axis=0)
        return positions + np.concatenate([np.zeros((1, len(positions))), moved])
