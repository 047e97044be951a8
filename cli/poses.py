"""Named poses as joint angles of a robot: how it rests, and the arm poses that the semantic banks share."""

import numpy as np

from gesture_bot.base.frames import KeypointClip
from gesture_bot.corpus.one_body import STANDARD
from gesture_bot.matching.arms import SIDES
from gesture_bot.matching.banks import shared_poses
from gesture_bot.matching.keyframes import Keyframe, Keyframes
from gesture_bot.retarget.kinematics import arm_joints
from gesture_bot.retarget.retargeter import Retargeter
from gesture_bot.retarget.robot import Robot

REST = "rest"

FRAMES = 30
"""A pose held for so many frames is reached by any robot that can."""


class Poses:
    """The poses that a robot can be sent to.

    Args:
        robot: Which.

    Attributes:
        names: Of the poses.
        parts: The joints of each part of the robot that can be posed, by its name.

    Raises:
        FileFormatError: config/banks/poses.yaml does not fit.
        RobotError: The robot's mapping does not.
    """

    def __init__(self, robot: Robot):
        self._robot = robot
        self._shared = shared_poses()
        self._retargeter = Retargeter(robot)
        self.names = (REST, *self._shared)
        arms = arm_joints(robot)
        self.parts = {
            "whole robot": robot.joints,
            "both arms": (*arms["left"], *arms["right"]),
            "left arm": arms["left"],
            "right arm": arms["right"],
        }

    def angles(self, name: str, part: str, present: np.ndarray) -> dict[str, float]:
        """Where the joints of a part are in a pose [rad]. But for `rest`, that is the arms alone.

        Args:
            name: Of the pose.
            part: Of the robot.
            present: (j,) where all joints are [rad]; of the ways to a pose, the nearest is taken.
        """
        if name == REST:
            pose, moved = self._robot.rest, set(self.parts[part])
        else:
            pose, moved = self._posed(name, present), set(self.parts[part]) & set(self.parts["both arms"])
        angles = zip(self._robot.joints, pose, strict=True)
        return {joint: float(angle) for joint, angle in angles if joint in moved}

    def _posed(self, name: str, present: np.ndarray) -> np.ndarray:
        """(j,) both arms in a pose [rad]."""
        held = Keyframes([Keyframe(time=0.0, hold=0.0, both=self._shared[name])])
        body = STANDARD[None]
        for side in SIDES:
            arm = held.arm(side, np.zeros(1), STANDARD)
            assert arm is not None
            body = arm.on(body, side)
        self._retargeter.reset(np.where(np.isnan(present), self._robot.rest, present))
        return self._retargeter.push(KeypointClip(0, np.repeat(body, FRAMES, axis=0))).positions[-1]
