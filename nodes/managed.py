"""A node that holds hardware: configured, activated and deactivated by the services of a lifecycle node."""

import traceback
from collections.abc import Callable
from typing import Any

from lifecycle_msgs.srv import ChangeState
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNodeMixin, LifecycleState, TransitionCallbackReturn

from gesture_bot.nodes.node import GestureNode

RCLError = rclpy_implementation.RCLError


class ManagedNode(LifecycleNodeMixin, GestureNode):
    """A managed node (REP-lifecycle of ROS 2): what `ros2 lifecycle` steers.

    A subclass says what its transitions do. It calls `bring_up` at the end of its constructor: unless the parameter
    `autostart` says otherwise, the node needs nobody who configures and activates it.
    """

    def __init__(self, name: str, **options: Any):
        GestureNode.__init__(self, name, **options)
        LifecycleNodeMixin.__init__(self)
        self._failure: Exception | None = None
        self._autostart = self.parameter(
            "autostart", True, "Whether the node configures and activates itself at the start"
        )
        self._service_change_state.callback = self._sound(self._service_change_state.callback)

    @property
    def state(self) -> str:
        """unconfigured, inactive, active or finalized."""
        return str(self._state_machine.current_state[1])
