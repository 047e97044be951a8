"""A node that holds hardware: what `ros2 lifecycle` and lifecycle managers steer."""

import traceback
from collections.abc import Callable
from typing import Any

from lifecycle_msgs.srv import ChangeState
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNodeMixin, LifecycleState, TransitionCallbackReturn

from gesture_bot.base.errors import GestureBotError
from gesture_bot.nodes.node import GestureNode

RCLError = rclpy_implementation.RCLError


class ManagedNode(LifecycleNodeMixin, GestureNode):
    """A lifecycle node of ROS 2: unconfigured, inactive or active.

    A subclass says what its transitions do; one that raises an error leaves the state as it was. The subclass
    calls `bring_up` when it is built.
    """

    def __init__(self, name: str, **options: Any):
        GestureNode.__init__(self, name, **options)
        LifecycleNodeMixin.__init__(self)
        self._autostart = self.parameter(
            "autostart", True, "Whether the node configures and activates itself, or a lifecycle manager does"
        )
        self._failure: Exception | None = None
        self._service_change_state.callback = self._checked(self._service_change_state.callback)

    def configure(self) -> None:
        """Take the hardware."""

    def activate(self) -> None:
        """Use it."""

    def deactivate(self) -> None:
        """Let it be, but keep it."""

    def cleanup(self) -> None:
        """Give it back; also after half a `configure`."""

    @property
    def state(self) -> str:
        """Such as unconfigured, inactive or active."""
        return str(self._state_machine.current_state[1])

    def bring_up(self) -> None:
        """Configure and activate, unless a lifecycle manager is to do it.

        Raises:
            GestureBotError: As the transitions do.
        """
        for trigger in (self.trigger_configure, self.trigger_activate) if self._autostart else ():
            if trigger() != TransitionCallbackReturn.SUCCESS:
                raise self._failure or GestureBotError(f"{self.get_name()} did not start")

    def destroy_node(self) -> None:
        """Give the hardware back."""
        if self.state in ("inactive", "active"):
            self.cleanup()
        super().destroy_node()

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:  # noqa: D102
        return self._carry_out(self.configure)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:  # noqa: D102
        return self._carry_out(self.activate)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:  # noqa: D102
        return self._carry_out(self.deactivate)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:  # noqa: D102
        return self._carry_out(self.cleanup)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:  # noqa: D102
        return self._carry_out(self.cleanup)

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:  # noqa: D102
        return self._carry_out(self.cleanup)

    def _carry_out(self, transition: Callable[[], None]) -> TransitionCallbackReturn:
        try:
            transition()
        except GestureBotError as error:
            self._failure = error
            return TransitionCallbackReturn.FAILURE
        except Exception as error:  # rclpy would swallow it
            self._failure = error
            self.get_logger().error(traceback.format_exc())
            return TransitionCallbackReturn.ERROR
        return TransitionCallbackReturn.SUCCESS

    def _checked(
        self, change: Callable[[ChangeState.Request, ChangeState.Response], ChangeState.Response]
    ) -> Callable[[ChangeState.Request, ChangeState.Response], ChangeState.Response]:
        """Answer a request that does not fit the state: in rclpy it would end the process."""

        def answer(request: ChangeState.Request, response: ChangeState.Response) -> ChangeState.Response:
            self._failure = None
            try:
                response = change(request, response)
            except RCLError:
                wanted = request.transition.label or request.transition.id
                self.get_logger().error(f"change_state: no transition {wanted} leads on from {self.state}")
                response.success = False
            if self._failure:
                self.get_logger().error(f"change_state: {self._failure}")
            return response

        return answer
