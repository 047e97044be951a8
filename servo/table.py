"""The servo table at work: joint angles to servo ticks and back."""

from collections.abc import Mapping

import numpy as np

from gesture_bot.retarget.robot import Robot, ServoEntry
from gesture_bot.servo.models import CENTRE, REGISTERS, TICKS_PER_RADIAN, VELOCITY_UNIT, find_model

PRESENT = np.dtype([("effort", "<i2"), ("velocity", "<i4"), ("position", "<i4")])
"""Present Current or Load (126), Present Velocity (128) and Present Position (132) lie side by side."""

PRESENT_ADDRESS = REGISTERS["Present Load"].address


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
        self._effort_unit = np.array([find_model(servo.model).effort_unit for servo in robot.servos])

    def ticks(self, positions: np.ndarray) -> np.ndarray:
        """Joint positions [rad] as servo positions [ticks]: (..., j) -> (..., j) int."""
        angles = self._direction * positions + self._offset
        return np.rint(CENTRE + TICKS_PER_RADIAN * angles).astype(int)

    def by_id(self, ticks: np.ndarray) -> Mapping[int, int]:
        """One row of numbers, keyed by ID."""
        return dict(zip(self.ids, ticks.tolist(), strict=True))

    def joint_state(self, present: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(j,) PRESENT records as joint positions [rad], velocities [rad/s] and efforts [N m]."""
        angles = (present["position"] - CENTRE) / TICKS_PER_RADIAN
        positions = self._direction * (angles - self._offset)
        velocities = self._direction * present["velocity"] * VELOCITY_UNIT
        return positions, velocities, self._direction * present["effort"] * self._effort_unit


def joint_angle(servo: ServoEntry, ticks: int) -> float:
    """Angle of a joint [rad] where its servo is at a position [ticks]."""
    return servo.direction * ((ticks - CENTRE) / TICKS_PER_RADIAN - servo.offset)
