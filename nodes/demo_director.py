"""Plays the user in `gesture-bot demo`: speaks, changes emotion and control, takes an arm for a while."""

import math
import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory as JointTrajectoryMessage

from gesture_bot.base.errors import GestureBotError
from gesture_bot.base.trajectory import JointTrajectory
from gesture_bot.msg import Constraint, Control, Emotion
from gesture_bot.nodes.discovery import refuse_company
from gesture_bot.nodes.messages import trajectory_to
from gesture_bot.nodes.node import PLAN, STATE
from gesture_bot.nodes.recorder import Recorder
from gesture_bot.retarget.kinematics import arm_joints
from gesture_bot.retarget.reach import WAVE, taken_up
from gesture_bot.retarget.robot import Robot
from gesture_bot.retarget.solver import DirectionSolver

SCRIPT = (
    ("neutral", False, "Hello, I am glad to see you here. I am a robot, and I talk with my hands."),
    ("sad", False, "Yesterday it rained all day, and nobody came to visit me. I felt small and very tired."),
    (
        "angry",
        False,
        "But then somebody took my chair away! That is not fair, and I will not stop saying so!",
    ),
    (
        "neutral",
        True,
        "Now the left hand stays high while I speak, because a control says so. It looks funny.",
    ),
    (
        "happy",
        False,
        "While you move my left arm, the other one goes on talking. Thank you, that was big fun!",
    ),
)
"""Emotion, whether the left wrist is kept high, and the sentences."""

TAKEN = 4
"""Line of SCRIPT during which the operator takes the left arm."""


class DemoDirector(Recorder):
    """Sees what passes and, from `play`, steers the graph through the topics that every user has."""

    def __init__(self, robot: Robot, name: str = "demo_director", **options: Any):
        super().__init__(name, **options)
        self._robot = robot
        self._say = self.create_publisher(String, "say", PLAN)
        self._emotion = self.create_publisher(Emotion, "emotion", STATE)
        self._control = self.create_publisher(Control, "control", STATE)
        self._teleop = self.create_publisher(JointTrajectoryMessage, "teleop/joint_trajectory", PLAN)

    def play(self) -> Iterator[None]:
        """The script, a step at a time: yields while it waits.

        Raises:
            GestureBotError: The graph did not start within 30 s, or another one is running.
        """
        yield from self._until(self._graph_stands, 30.0)
        refuse_company(self, 1)  # whom a busy machine had not found before
        for line, (emotion, left_high, text) in enumerate(SCRIPT):
            self._emotion.publish(Emotion(expression=emotion))
            high = Constraint(quantity=Constraint.WRIST_HEIGHT, hand=Constraint.LEFT, value=85.0)
            self._control.publish(Control(constraints=[high] if left_high else []))
            spoken = self._utterances()
            self._say.publish(String(data=text))
            if line == TAKEN:
                yield from self._take_left_arm(1.5, 4.0)
            yield from self._until(partial(self._spoken_more_than, spoken), 30.0)
            yield from self._wait(self.record.audio[-1].stamp + 0.7 - self.now())
        yield from self._wait(1.5)

    def _utterances(self) -> int:
        """How many utterances are out to their end."""
        return sum(heard.message.last for heard in self.record.audio)

    def _spoken_more_than(self, utterances: int) -> bool:
        return self._utterances() > utterances

    def _graph_stands(self) -> bool:
        return bool(self.record.joint_states and self.record.refined and self._say.get_subscription_count())

    def _take_left_arm(self, after: float, length: float) -> Iterator[None]:
        """Wave with the left arm: an operator's joint trajectory, sent ten times a second."""
        yield from self._wait(after)
        joints = arm_joints(self._robot)["left"]
        columns = [self._robot.joints.index(joint) for joint in joints]
        solver = DirectionSolver(self._robot)
        out = taken_up(self._robot, solver, WAVE[0], self._robot.rest)
        back = taken_up(self._robot, solver, WAVE[1], out)
        centre, swing = ((out + back) / 2)[columns], ((back - out) / 2)[columns]
        begin = self.now()
        while (now := self.now()) < begin + length:
            times = now + np.arange(0.0, 0.4, 0.05)
            phase = 2 * math.pi * 0.5 * (times - begin)[:, None]
            positions, velocities = centre - swing * np.cos(phase), swing * math.pi * np.sin(phase)
            trajectory = JointTrajectory(joints, times, positions, velocities)
            self._teleop.publish(trajectory_to(trajectory))
            yield from self._wait(0.1)

    def _wait(self, length: float) -> Iterator[None]:
        end = self.now() + length
        yield from self._until(lambda: self.now() >= end, max(length, 0.0) + 1.0)

    def _until(self, condition: Callable[[], bool], limit: float) -> Iterator[None]:
        give_up = time.monotonic() + limit
        while not condition():
            if time.monotonic() > give_up:
                raise GestureBotError("the graph did not answer within", f"{limit:g} s")
            yield
