"""The servo table at work: joint angles to servo ticks and back."""

from collections.abc import Mapping

import numpy as np

from gesture_bot.base.errors import RobotError
from gesture_bot.retarget.robot import Robot, ServoEntry
from gesture_bot.servo.models import Series, find_model

PRESENT = np.dtype([("effort", "<i2"), ("velocity", "<i4"), ("position", "<i4")])
"""Present Current or Load (126), Present Velocity (128) and Present Position (132) lie side by side."""


def series_of(robot: Robot) -> dict[str, Series]:
    """The series of each bus of a robot: servos on one bus share their packets, and so their addresses.

    Raises:
        RobotError: The table names an unknown model, or models of several series on one bus.
    """
    found = {}
    for bus in robot.buses:
        series = {find_model(servo.model).series for servo in robot.servos if servo.bus == bus}
        if len(series) > 1:
            raise RobotError("servos of one bus must be of one series", sorted(one.name for one in series))
        found[bus] = series.pop()
    return found


class ServoTable:
    """Units and directions of a robot's servos.

    Attributes:
        ids: Dynamixel IDs, in joint order.

    Raises:
        RobotError: The table names an unknown model.
    """

    def __init__(self, robot: Robot):
        self.ids = [servo.id for servo in robot.servos]
        self._direction = np.array([servo.direction for servo in robot.servos], float)
        self._offset = np.array([servo.offset for servo in robot.servos])
        models = [find_model(servo.model) for servo in robot.servos]
        self._centre = np.array([model.centre for model in models])
        self._scale = np.array([model.ticks_per_radian for model in models])
        self._velocity_unit = np.array([model.series.velocity_unit for model in models])
        self._effort_unit = np.array([model.effort_unit for model in models])

    def ticks(self, positions: np.ndarray) -> np.ndarray:
        """Joint positions [rad] as servo positions [ticks]: (..., j) -> (..., j) int."""
        angles = self._direction * positions + self._offset
        return np.rint(self._centre + self._scale * angles).astype(int)

    def positions(self, ticks: np.ndarray) -> np.ndarray:
        """Servo positions [ticks] as joint positions [rad]: (..., j) -> (..., j)."""
        return self._direction * ((ticks - self._centre) / self._scale - self._offset)

    def by_id(self, ticks: np.ndarray) -> Mapping[int, int]:
        """One row of numbers, keyed by ID."""
        return dict(zip(self.ids, ticks.tolist(), strict=True))

    def joint_state(self, present: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(j,) PRESENT records as joint positions [rad], velocities [rad/s] and efforts [N m]."""
        velocities = self._direction * present["velocity"] * self._velocity_unit
        efforts = self._direction * present["effort"] * self._effort_unit
        return self.positions(present["position"]), velocities, efforts


def joint_angle(servo: ServoEntry, ticks: int) -> float:
    """Angle of a joint [rad] where its servo is at a position [ticks]."""
    model = find_model(servo.model)
    return servo.direction * ((ticks - model.centre) / model.ticks_per_radian - servo.offset)
