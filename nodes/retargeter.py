"""Keypoints in, trajectories of the robot's joints out: for gestures, and for an operator's own body."""

import time
from typing import Any

from trajectory_msgs.msg import JointTrajectory

from gesture_bot.base.frames import FRAME_RATE
from gesture_bot.msg import GestureWindow
from gesture_bot.nodes.messages import clip_from, trajectory_to
from gesture_bot.nodes.node import PLAN, GestureNode, diagnostic
from gesture_bot.retarget.retargeter import Retargeter as RobotRetargeter
from gesture_bot.retarget.robot import load_robot


class Retargeter(GestureNode):
    """Moves the robot's arms and head in the directions of the human's."""

    def __init__(self, name: str = "retargeter", **options: Any):
        super().__init__(name, **options)
        robot = load_robot(self.parameter("robot", "toa", "Robot: a name in config/robots, or a YAML file"))
        self._windows = {"gesture": 0, "teleop": 0}
        self._load = 0.0
        self._connect("gesture", "gesture/refined", RobotRetargeter(robot))
        self._connect("teleop", "teleop/keypoints", RobotRetargeter(robot))
        self.every(1.0, self._report)
        self.waits_for("keypoints on gesture/refined and teleop/keypoints")

    def _connect(self, source: str, keypoints: str, robot_retargeter: RobotRetargeter) -> None:
        publisher = self.create_publisher(JointTrajectory, f"{source}/joint_trajectory", PLAN)

        def on_keypoints(message: GestureWindow) -> None:
            begin, clip = time.perf_counter(), clip_from(message)
            publisher.publish(trajectory_to(robot_retargeter.push(clip)))
            self._windows[source] += 1
            self._load = max(self._load, (time.perf_counter() - begin) * FRAME_RATE / len(clip.keypoints))

        self.listen(GestureWindow, keypoints, on_keypoints, PLAN)

    def _report(self) -> None:
        """The load is the time taken for the slowest window of the last second, as a share of its length."""
        load, self._load = self._load, 0.0
        slow = [f"too slow: {load:.1f} s for a second of motion"] if load > 1.0 else []
        self.diagnose(
            diagnostic(
                "retargeter",
                slow + self.errors(),
                "running",
                load_percent=round(100 * load),
                gesture_windows=self._windows["gesture"],
                teleop_windows=self._windows["teleop"],
            )
        )
