"""Keypoints in, trajectories of the robot's joints out: for gestures, and for an operator's own body."""

from typing import Any

from trajectory_msgs.msg import JointTrajectory

from gesture_bot.msg import GestureWindow
from gesture_bot.nodes.messages import clip_from, trajectory_to
from gesture_bot.nodes.node import PLAN, GestureNode
from gesture_bot.retarget.retargeter import Retargeter as RobotRetargeter
from gesture_bot.retarget.robot import load_robot


class Retargeter(GestureNode):
    """Moves the robot's arms and head in the directions of the human's."""

    def __init__(self, name: str = "retargeter", **options: Any):
        super().__init__(name, **options)
        robot = load_robot(self.parameter("robot", "toa", "Robot: a name in config/robots, or a YAML file"))
        for keypoints, joints in (
            ("gesture/refined", "gesture/joint_trajectory"),
            ("teleop/keypoints", "teleop/joint_trajectory"),
        ):
            self._connect(keypoints, joints, RobotRetargeter(robot))
        self.waits_for("keypoints on gesture/refined and teleop/keypoints")

    def _connect(self, keypoints: str, joints: str, robot_retargeter: RobotRetargeter) -> None:
        publisher = self.create_publisher(JointTrajectory, joints, PLAN)

        def on_keypoints(message: GestureWindow) -> None:
            publisher.publish(trajectory_to(robot_retargeter.push(clip_from(message))))

        self.listen(GestureWindow, keypoints, on_keypoints, PLAN)
