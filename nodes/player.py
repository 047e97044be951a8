"""Plays a recording: what the joints were told then, and what was heard."""

import math
import time
from pathlib import Path
from typing import Any

from rclpy.serialization import deserialize_message

from gesture_bot.base.errors import GestureBotError, InvalidValueError
from gesture_bot.nodes.node import PLAN, STREAM, GestureNode
from gesture_bot.recording.definitions import message_class
from gesture_bot.recording.reader import Recorded, Recording
from gesture_bot.retarget.robot import load_robot

LEAD = 0.5
"""Messages are published so much earlier than they were, so that each is there before its stamp [s]."""

APPROACH = 3.0
"""The robot has at least so long to come to where the recording begins [s]."""

DISCOVERY = 1.0
"""So long it takes to hear of others [s]."""

LAST = 1.0
"""From the last message to the end of the graph [s]."""


class Player(GestureNode):
    """Publishes a recording with its stamps moved by a whole number of seconds.

    What the mux sent to the driver goes to the mux as a gesture. So the joints get what they got then,
    whoever asked for it: gestures, an operator, a stop. Whoever is there now can stop the robot or take it
    over. A robot that has other joints gets the recorded keypoints instead.
    """

    def __init__(self, name: str = "player", **options: Any):
        super().__init__(name, **options)
        self._recording = Recording(Path(self.parameter("recording", "", "MCAP file to play")))
        robot = load_robot(self.parameter("robot", "toa", "Robot: a name in config/robots, or a YAML file"))
        motion = self._motion(robot.joints)
        time.sleep(DISCOVERY)
        self._refuse_company(0)
        self._publishers_by_topic = {}
        for recorded, topic, qos in (
            (motion, "gesture/joint_trajectory" if motion == "joint_trajectory" else motion, PLAN),
            ("speech/audio", "speech/audio", STREAM),
            ("speech/cut", "speech/cut", PLAN),
        ):
            full = self._recording.topic(recorded)
            if full in self._recording.topics:
                message_type = message_class(self._recording.topics[full])
                self._publishers_by_topic[full] = self.create_publisher(message_type, topic, qos)
        self._first = next(self._recording.messages(self._recording.topic(motion)))
        self._waiting = self._recording.messages(*self._publishers_by_topic)
        self._next = next(self._waiting, None)
        self._shift = 0
        if self._recording.cut_off:
            self.get_logger().warning("the end of the recording is missing; what is whole is played")
        self.every(0.04, self._play)
        self.waits_for("the rest of the graph")

    def _motion(self, joints: tuple[str, ...]) -> str:
        """The recorded topic that moves a robot with these joints."""
        commands = self._recording.topic("joint_trajectory")
        if commands in self._recording.topics:
            names = _message(next(self._recording.messages(commands))).joint_names
            if set(names) <= set(joints):
                return "joint_trajectory"
        if self._recording.topic("gesture/refined") in self._recording.topics:
            return "gesture/refined"
        raise InvalidValueError(
            f"{self._recording.path} moves no robot with these joints: it has no gesture/refined, and "
            "no joint_trajectory of them",
            ", ".join(joints),
        )

    def _refuse_company(self, own: int) -> None:
        if self.count_publishers("joint_trajectory") > own:
            message = "a graph is running already; end it, or set namespace:=. It publishes"
            raise GestureBotError(message, self.resolve_topic_name("joint_trajectory"))

    def _play(self) -> None:
        now = self.now()
        if not self._shift:
            try:
                self._refuse_company(1)  # whom a busy machine had not found before
            except GestureBotError:
                self.context.try_shutdown()
                raise
            if self._publishers_by_topic[self._first.topic].get_subscription_count():
                self._begin(now)
            return
        while self._next and self._next.received * 1e-9 + self._shift - LEAD <= now:
            self._publish(self._next)
            self._next = next(self._waiting, None)
        if not self._next and now > self._recording.end * 1e-9 + self._shift + LAST:
            self.context.try_shutdown()

    def _begin(self, now: float) -> None:
        # A whole number: frames stay on their grid, and stamps keep all their digits.
        self._shift = math.ceil(now + APPROACH - self._recording.begin * 1e-9)
        self.get_logger().info(f"plays {self._recording.duration:.1f} s of {self._recording.path}")
        self._publish(self._first)

    def _publish(self, recorded: Recorded) -> None:
        message = _message(recorded)
        if message.header.stamp.sec:
            message.header.stamp.sec += self._shift
        self._publishers_by_topic[recorded.topic].publish(message)


def _message(recorded: Recorded) -> Any:
    return deserialize_message(recorded.data, message_class(recorded.type_name))
