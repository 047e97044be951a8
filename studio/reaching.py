"""Joint angles with which a wrist is at a point."""

import numpy as np
from scipy.optimize import least_squares

from gesture_bot.retarget.kinematics import Kinematics, arm_joints
from gesture_bot.retarget.robot import Robot

STAY = 0.02
"""Weight of a joint's way from where it is [m/rad]: the elbow does not swing where it is free."""


class Reaching:
    """Moves one arm of a robot so that its wrist comes as near to a point as the joints' limits let it.

    Args:
        robot: Whose arm.
        side: left or right.

    Attributes:
        joints: Those of the arm.
    """

    def __init__(self, robot: Robot, side: str):
        self._kinematics = Kinematics(robot)
        self._arm = robot.mapping.left_arm if side == "left" else robot.mapping.right_arm
        self._link = np.array([self._kinematics.link(self._arm.wrist)])
        self.joints = arm_joints(robot)[side]
        self._columns = [robot.joints.index(joint) for joint in self.joints]
        self._bounds = robot.limits.lower[self._columns], robot.limits.upper[self._columns]

    def wrist(self, angles: np.ndarray) -> np.ndarray:
        """(3,) where the wrist is at (j,) joint angles [rad], in the robot's base frame [m]."""
        self._kinematics.place(angles)
        return self._kinematics.position(self._arm.wrist, self._arm.wrist_at)

    def solve(self, point: np.ndarray, start: np.ndarray) -> dict[str, float]:
        """The angles of the arm's joints [rad].

        Args:
            point: (3,) where the wrist is wanted, in the robot's base frame [m].
            start: (j,) angles of all joints to start from [rad].
        """
        angles, begin = start.copy(), np.clip(start[self._columns], *self._bounds)

        def miss(moved: np.ndarray) -> np.ndarray:
            angles[self._columns] = moved
            return np.concatenate([self.wrist(angles) - point, STAY * (moved - begin)])

        def slope(moved: np.ndarray) -> np.ndarray:
            angles[self._columns] = moved
            wrist = self.wrist(angles)
            moving = self._kinematics.jacobians(self._link, wrist[None])[0, 0][:, self._columns]
            return np.concatenate([moving, STAY * np.eye(len(moved))])

        found = least_squares(miss, begin, slope, self._bounds, max_nfev=30)
        return dict(zip(self.joints, found.x.tolist(), strict=True))
