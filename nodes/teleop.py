"""What operators' nodes share: where the joints are, whose they are, and the motion that is asked of them."""

import time
from collections.abc import Iterable
from typing import Any

import numpy as np
from rclpy.callback_groups import CallbackGroup
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from trajectory_msgs.msg import JointTrajectory

from gesture_bot.msg import JointOwners
from gesture_bot.nodes.messages import trajectory_to
from gesture_bot.nodes.node import PLAN, STATE, GestureNode
from gesture_bot.retarget.robot import Robot
from gesture_bot.servo.arbitration import STOP
from gesture_bot.servo.jog import PERIOD, Jog

NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Joint states: only the last one matters."""

STALE = 0.5
"""A joint is somewhere else when it was measured so long ago [s]."""


class Operator(GestureNode):
    """Moves a robot's joints by hand, once `follow` is called.

    Attributes:
        owners: Who owns each joint, by its name; empty until that is heard.
        joint_states: The subscription, once it follows.
        ticking: The timer that moves the joints that are taken.
    """

    def __init__(self, name: str, **options: Any):
        super().__init__(name, **options)
        self._trajectories = self.create_publisher(JointTrajectory, "teleop/joint_trajectory", PLAN)
        # Not latched: it must not outlive a reset. The default callbacks would warn of who wants it latched.
        silent = PublisherEventCallbacks(use_default_callbacks=False)
        self._stop = self.create_publisher(Bool, "stop", PLAN, event_callbacks=silent)
        self.owners: dict[str, str] = {}

    def follow(self, robot: Robot, group: CallbackGroup | None = None) -> None:
        """Listen to the robot's joints, their states in a callback group, and move those that are taken."""
        self.jog = Jog(robot.limits)
        self._columns = {joint: column for column, joint in enumerate(robot.joints)}
        self._positions = np.full(len(robot.joints), np.nan)
        self._measured_at = np.full(len(robot.joints), -np.inf)
        self.joint_states = self.listen(JointState, "joint_states", self._on_joint_state, NEWEST, group)
        self.listen(JointOwners, "motion_mux/owners", self._on_owners, STATE)
        self.ticking = self.every(PERIOD, self._tick)

    @property
    def measured(self) -> np.ndarray:
        """(j,) where the joints are [rad]; NaN where that has not been heard lately."""
        return np.where(time.monotonic() - self._measured_at < STALE, self._positions, np.nan)

    @property
    def stopped(self) -> bool:
        """Whether the robot is stopped."""
        return STOP in self.owners.values()

    def take(self, joints: Iterable[str]) -> None:
        """Take joints where they are.

        Raises:
            InvalidValueError: A joint is unknown, or it is not known where it is.
        """
        self.jog.take(joints, self.measured)

    def stop(self) -> None:
        """Stop the robot, until somebody calls `reset`."""
        self._stop.publish(Bool(data=True))
        self.give_all_back()

    def give_all_back(self) -> None:
        """Leave all joints to others, as after a stop, whoever asked for it."""
        self.jog.give_back(self.jog.taken)

    def _on_owners(self, message: JointOwners) -> None:
        self.owners = dict(zip(message.joints, message.owners, strict=False))
        if self.stopped:
            self.give_all_back()

    def _on_joint_state(self, message: JointState) -> None:
        for joint, position in zip(message.name, message.position, strict=False):
            if joint in self._columns:
                self._positions[self._columns[joint]] = position
                self._measured_at[self._columns[joint]] = time.monotonic()

    def _tick(self) -> None:
        trajectory = self.jog.tick(self.now(), self.measured)
        if trajectory:
            self._trajectories.publish(trajectory_to(trajectory))
