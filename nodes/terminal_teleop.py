"""The node behind `gesture-bot teleop`."""

from typing import Any

from std_srvs.srv import Trigger

from gesture_bot.nodes.teleop import Operator
from gesture_bot.retarget.robot import Robot


class TerminalTeleop(Operator):
    """An operator who moves joints from the start, and may reset a stop."""

    def __init__(self, robot: Robot, name: str = "terminal_teleop", **options: Any):
        super().__init__(name, **options)
        self._reset = self.create_client(Trigger, "reset")
        self.follow(robot)

    def reset(self) -> bool:
        """Ask for the end of a stop; whether there is somebody to ask."""
        if not self._reset.service_is_ready():
            return False
        self._reset.call_async(Trigger.Request())
        return True
