"""The node behind `gesture-bot teleop`: moves joints, knows whose they are, stops and resets."""

from typing import Any

from std_srvs.srv import Trigger

from gesture_bot.msg import JointOwners
from gesture_bot.nodes.node import STATE
from gesture_bot.nodes.teleop import Operator
from gesture_bot.retarget.robot import Robot
from gesture_bot.servo.arbitration import STOP


class TerminalTeleop(Operator):
    """An operator who sees who owns each joint; a stop, whoever asks for it, leaves all joints.

    Attributes:
        owners: Who owns each joint, by its name; empty until that is heard.
    """

    def __init__(self, robot: Robot, name: str = "terminal_teleop", **options: Any):
        super().__init__(name, **options)
        self.owners: dict[str, str] = {}
        self._reset = self.create_client(Trigger, "reset")
        self.follow(robot)
        self.listen(JointOwners, "motion_mux/owners", self._on_owners, STATE)

    @property
    def stopped(self) -> bool:
        """Whether the robot is stopped."""
        return STOP in self.owners.values()

    def reset(self) -> bool:
        """Ask for the end of a stop; whether there is somebody to ask."""
        if not self._reset.service_is_ready():
            return False
        self._reset.call_async(Trigger.Request())
        return True

    def _on_owners(self, message: JointOwners) -> None:
        self.owners = dict(zip(message.joints, message.owners, strict=False))
        if self.stopped:
            self.jog.give_back(self.jog.taken)
