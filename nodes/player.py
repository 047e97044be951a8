"""Plays a recording: what the joints were told then, and what was heard."""

import math
import time
from pathlib import Path
from typing import Any

import numpy as np
from rclpy.serialization import deserialize_message
from trajectory_msgs.msg import JointTrajectory as JointTrajectoryMessage

from gesture_bot.base.errors import GestureBotError, InvalidValueError
from gesture_bot.base.trajectory import JointTrajectory
from gesture_bot.nodes.discovery import DISCOVERY, refuse_company
from gesture_bot.nodes.messages import trajectory_from, trajectory_to
from gesture_bot.nodes.node import PLAN, STREAM, GestureNode
from gesture_bot.recording.commands import commanded_motion
from gesture_bot.recording.definitions import message_class
from gesture_bot.recording.reader import Recorded, Recording
from gesture_bot.retarget.robot import load_robot

LEAD = 0.5
"""So much of the motion is published ahead, and messages so much earlier than they were [s]."""

PERIOD = 0.04
"""From one piece of the motion to the next [s]."""

APPROACH = 3.0
"""The robot has at least so long to come to where the recording begins [s]."""

LAST = 1.0
"""From the last message to the end of the graph [s]."""


class Player(GestureNode):
    """Publishes a recording with its stamps moved by a whole number of seconds.

    What the mux told the driver goes to the mux as a gesture. So the joints are told what they were told
    then, whoever asked for it: gestures, an operator, a stop. Whoever is there now can stop the robot or take
    it over. A robot that has other joints gets the recorded keypoints instead.
    """

    def __init__(self, name: str = "player", **options: Any):
        super().__init__(name, **options)
        self._recording = Recording(Path(self.parameter("recording", "", "MCAP file to play")))
        robot = load_robot(self.parameter("robot", "toa", "Robot: a name in config/robots, or a YAML file"))
        self._motion = self._commands(robot.joints)
        time.sleep(DISCOVERY)
        refuse_company(self)
        self._gesture = self.create_publisher(JointTrajectoryMessage, "gesture/joint_trajectory", PLAN)
        self._messages = {}
        for topic, qos in (("gesture/refined", PLAN), ("speech/audio", STREAM), ("speech/cut", PLAN)):
            full = self._recording.topic(topic)
            if full in self._recording.topics and not (self._motion and topic == "gesture/refined"):
                message_type = message_class(self._recording.topics[full])
                self._messages[full] = self.create_publisher(message_type, topic, qos)
        self._waiting = self._recording.messages(*self._messages) if self._messages else iter(())
        self._next = next(self._waiting, None)
        self._shift = 0
        if self._recording.cut_off:
            self.get_logger().warning("the end of the recording is missing; what is whole is played")
        self.every(PERIOD, self._play)
        self.waits_for("the rest of the graph")

    def _commands(self, joints: tuple[str, ...]) -> JointTrajectory | None:
        """What the joints of this robot were told; None if another one was recorded, with keypoints.

        Raises:
            InvalidValueError: Neither is there.
        """
        topic = self._recording.topic("joint_trajectory")
        if topic in self._recording.topics:
            commands = map(_message, self._recording.messages(topic))
            motion = commanded_motion(trajectory_from(command, self.now()) for command in commands)
            if set(motion.joints) <= set(joints):
                return motion
        if self._recording.topic("gesture/refined") in self._recording.topics:
            return None
        raise InvalidValueError(
            f"{self._recording.path} moves no robot with these joints: it has no gesture/refined, and "
            "no joint_trajectory of them",
            ", ".join(joints),
        )

    def _play(self) -> None:
        now = self.now()
        if not self._shift:
            try:
                refuse_company(self, 1)  # whom a busy machine had not found before
            except GestureBotError:
                self.context.try_shutdown()
                raise
            if not self._gesture.get_subscription_count():
                return
            # A whole number: frames stay on their grid, and stamps keep all their digits.
            self._shift = math.ceil(now + APPROACH - self._recording.begin * 1e-9)
            self.get_logger().info(f"plays {self._recording.duration:.1f} s of {self._recording.path}")
        if self._motion:
            self._move(self._motion, now - self._shift)
        while (due := self._next) and due.received * 1e-9 + self._shift - LEAD <= now:
            self._next = None  # where the rest is damaged, this is the last
            self._publish(due)
            self._next = next(self._waiting, None)
        if now > self._recording.end * 1e-9 + self._shift + LAST:
            self.context.try_shutdown()

    def _move(self, motion: JointTrajectory, then: float) -> None:
        """Publish the piece that begins at the last point before a moment of the recording.

        Pieces share their points, so that each goes on from the one before without any difference. Before the
        first point, the robot goes there and waits.
        """
        first = max(0, int(np.searchsorted(motion.times, then)) - 1)
        piece = slice(first, max(first + 2, int(np.searchsorted(motion.times, then + LEAD))))
        if motion.times[-1] > then:
            times = motion.times[piece] + self._shift
            self._gesture.publish(
                trajectory_to(
                    JointTrajectory(motion.joints, times, motion.positions[piece], motion.velocities[piece])
                )
            )

    def _publish(self, recorded: Recorded) -> None:
        message = _message(recorded)
        if message.header.stamp.sec:
            message.header.stamp.sec += self._shift
        self._messages[recorded.topic].publish(message)


def _message(recorded: Recorded) -> Any:
    return deserialize_message(recorded.data, message_class(recorded.type_name))
