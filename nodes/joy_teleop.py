"""An operator with a gamepad: while an arm's deadman button is held, the sticks move its joints."""

import time
from typing import Any

from sensor_msgs.msg import Joy

from gesture_bot.base.errors import GestureBotError
from gesture_bot.nodes.node import PLAN, diagnostic
from gesture_bot.nodes.teleop import Operator
from gesture_bot.retarget.kinematics import arm_joints
from gesture_bot.retarget.robot import load_robot
from gesture_bot.servo.gamepad import SIDES, load_gamepad
from gesture_bot.servo.jog import PERIOD

QUIET = 0.2
"""The sticks of a pad that has been silent for so long are taken to be in their middle [s]."""

SILENT = 0.5
"""All buttons of a pad that has been silent for so long are taken to be let go [s]."""


class JoyTeleop(Operator):
    """Listens to a gamepad; until the first message comes, to nothing else."""

    def __init__(self, name: str = "joy_teleop", **options: Any):
        super().__init__(name, **options)
        self._robot = load_robot(
            self.parameter("robot", "toa", "Robot: a name in config/robots, or a YAML file")
        )
        self._gamepad = load_gamepad(
            self.parameter("assignment", "shipped", "What buttons and axes do: a YAML file, or 'shipped'")
        )
        self._arms = arm_joints(self._robot)
        self._following = False
        self._heard = -float("inf")
        self._stopped = False
        self._let_go = set(SIDES)  # arms whose button has been free since the last stop
        self._told = ""
        self.listen(Joy, "joy", self._on_joy, PLAN)
        self.every(1.0, self._report)
        self.waits_for("a gamepad on joy")

    def give_all_back(self) -> None:
        """Leave both arms, each until its button has been let go and is pressed again."""
        super().give_all_back()
        self._let_go.clear()

    def _on_joy(self, message: Joy) -> None:
        self._heard = time.monotonic()
        if not self._following:
            self._following = True
            self.follow(self._robot)
            self.every(PERIOD, self._watch)
        try:
            self._obey(message)
        except GestureBotError as error:
            self.jog.give_back(self.jog.taken)
            # The same again, twenty times a second, helps nobody.
            if str(error) != self._told:
                self._told = str(error)
                raise
        else:
            self._told = ""

    def _obey(self, message: Joy) -> None:
        stopped, self._stopped = self._stopped, self._gamepad.stops(message.buttons)
        if self._stopped and not stopped:
            self.stop()
            self.get_logger().info("stop")
        if self.stopped:
            self.give_all_back()
        for side in SIDES:
            joints = self._arms[side]
            velocities = self._gamepad.velocities(side, message.axes, message.buttons, len(joints))
            if not self._gamepad.holds(side, message.buttons):
                self._let_go.add(side)
                self.jog.give_back(joints)
            elif side in self._let_go:
                self.take(joints)
                self.jog.move(dict(zip(joints, velocities, strict=False)))

    def _watch(self) -> None:
        silence = time.monotonic() - self._heard
        if silence > SILENT:
            self.jog.give_back(self.jog.taken)
        elif silence > QUIET:
            self.jog.move(dict.fromkeys(self.jog.taken, 0.0))

    def _report(self) -> None:
        there = time.monotonic() - self._heard < SILENT
        held = self.jog.taken if self._following else ()
        state = f"moves {', '.join(held)}" if held else "no button is held" if there else "no gamepad"
        self.diagnose(diagnostic("joy teleop", [self._told] if self._told else [], state))
