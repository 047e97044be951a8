"""Joints against their goals: one that is blocked or pushed away is noticed, and yields."""

from collections import deque

import numpy as np

from gesture_bot.retarget.robot import Robot
from gesture_bot.servo.models import find_model

ERROR = 0.08
"""A joint this far from all its recent goals is not where it should be [rad]. With the factory's gain, an
XL430 that holds a quarter of its stall torque is 0.07 rad off its goal."""

LOAD = 0.2
"""Share of the stall torque above which its servo pushes against something, and below which it is limp."""

LAG = 0.045
MARGIN = 0.03
"""Recent are the goals of the lag that the robot's file names, or LAG if longer, and MARGIN more [s]."""

CONFIRMED = 0.03
"""It must stay so for so long [s]."""

YIELD_TIME = 2.0
"""How long a joint yields before it tries again, slowly [s]."""


class Following:
    """Compares where the joints are with where they were sent.

    A joint that is blocked at 0.5 rad/s is noticed about 0.27 s later: after 0.16 s its goal is ERROR away;
    the rest is the lag, in which it could still be on the way. A faster one is noticed sooner, a slower one
    later.

    Args:
        robot: Whose joints they are.
        dt: Length of a tick [s].

    Attributes:
        yielding: (j,) which joints yield.
        limp: (j,) which are off their goals without any torque: their servos do nothing.
        blocks: How often a joint has begun to yield so far.
    """

    def __init__(self, robot: Robot, dt: float):
        count = len(robot.joints)
        self.yielding = np.zeros(count, bool)
        self.limp = np.zeros(count, bool)
        self.blocks = 0
        self._torque = np.array([find_model(servo.model).torque for servo in robot.servos])
        self._dt = dt
        recent = max(robot.bus.lag_ms / 1000, LAG) + MARGIN
        self._sent: deque[np.ndarray] = deque(maxlen=round(recent / dt))
        self._against = np.zeros(count)
        self._slack = np.zeros(count)
        self._place = np.zeros(count)
        self._until = np.full(count, -np.inf)

    def compare(
        self, sent: np.ndarray, measured: np.ndarray, efforts: np.ndarray, watched: np.ndarray, now: float
    ) -> None:
        """Take note of a cycle.

        Args:
            sent: (j,) goals [rad].
            measured: (j,) [rad].
            efforts: (j,) [N m].
            watched: (j,) which joints are in service and were heard.
            now: [s].
        """
        self._sent.append(sent)
        goals = np.array(self._sent)
        off = np.maximum(goals.min(axis=0) - measured, 0.0) - np.maximum(measured - goals.max(axis=0), 0.0)
        load = np.sign(off) * efforts / self._torque
        astray = watched & (np.abs(off) > ERROR)
        self._against = np.where(astray & (load > LOAD), self._against + self._dt, 0.0)
        self._slack = np.where(astray & (load <= LOAD), self._slack + self._dt, 0.0)
        self.limp = self._slack >= CONFIRMED - 1e-9
        blocked = self._against >= CONFIRMED - 1e-9
        self.blocks += int(np.count_nonzero(blocked & ~self.yielding))
        self._place = np.where(blocked, measured, self._place)
        self._until = np.where(blocked, now + YIELD_TIME, self._until)
        self.yielding = self.yielding | blocked

    def release(self, now: float) -> np.ndarray:
        """(j,) which joints have yielded for long enough, and may try again."""
        over = self.yielding & (now >= self._until)
        self.yielding = self.yielding & ~over
        return over

    def soften(self, positions: np.ndarray, velocities: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Targets [rad, rad/s] of which those that yield are where their joints were pushed to."""
        return (
            np.where(self.yielding, self._place, positions),
            np.where(self.yielding, 0.0, velocities),
        )
