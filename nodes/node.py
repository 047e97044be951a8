"""What the nodes share: described parameters, guarded callbacks, and the quality of service."""

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.callback_groups import CallbackGroup
from rclpy.context import Context
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from rclpy.time import Time
from rclpy.timer import Timer

from gesture_bot.base.errors import GestureBotError, InvalidValueError

STREAM = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Sound and features: sensor data. Deep enough for the two seconds that text arrives ahead of its sound."""

PLAN = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)
"""Words, windows and trajectories: each one matters, and the words of a text come all at once."""

STATE = QoSProfile(
    depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
"""Emotion, control, stop and modes: a late joiner gets the current one."""


REMEMBERED = 10.0
"""For so long an error is told on /diagnostics [s]."""

ECHO = 0.1
"""The same state again within so long was heard by both subscriptions to it [s]."""


@contextmanager
def until_shutdown(context: Context) -> Iterator[None]:
    """For an executor to spin in: rclpy's context ends when a signal comes, at any moment."""
    try:
        yield
    except ExternalShutdownException:
        pass
    except RuntimeError:
        # The signal may come while a message is taken, and ends the context a moment later.
        if context.ok():
            time.sleep(0.2)
        if context.ok():
            raise


class GestureNode(Node):
    """A node whose parameters are described, and whose callbacks answer bad input with one clear line."""

    _diagnostics: Publisher | None = None

    def __init__(self, name: str, **options: Any):
        super().__init__(name, **options)
        self._errors: dict[str, tuple[str, float]] = {}

    def parameter(
        self,
        name: str,
        default: Any,
        description: str,
        *,
        bounds: tuple[float, float] | None = None,
        choices: Iterable[str] = (),
    ) -> Any:
        """Declare a parameter that is read once, at the start, and return its value.

        Args:
            name: Its name.
            default: Its default, which also fixes its type.
            description: A sentence, with the unit.
            bounds: Smallest and largest valid number.
            choices: The valid strings.

        Raises:
            InvalidValueError: The value is of another type, out of bounds, or not among the choices.
        """
        descriptor = ParameterDescriptor(description=description, read_only=True)
        if bounds and isinstance(default, int):
            descriptor.integer_range = [
                IntegerRange(from_value=int(bounds[0]), to_value=int(bounds[1]), step=0)
            ]
        elif bounds:
            descriptor.floating_point_range = [FloatingPointRange(from_value=bounds[0], to_value=bounds[1])]
        choices = tuple(choices)
        descriptor.additional_constraints = f"One of: {', '.join(choices)}" if choices else ""
        try:
            value = self.declare_parameter(name, default, descriptor).value
        except Exception as error:  # rclpy raises several unrelated classes here
            raise InvalidValueError(
                f"parameter {name} of {self.get_name()} ({' '.join(str(error).split())})"
            ) from error
        if choices and value not in choices:
            raise InvalidValueError(f"parameter {name} of {self.get_name()}", value, choices)
        return value

    def listen(
        self,
        message_type: type,
        topic: str,
        callback: Callable[[Any], None],
        qos: QoSProfile,
        group: CallbackGroup | None = None,
    ) -> Subscription:
        """Subscribe; a bad message is logged in one line and changes nothing."""
        guarded = self._guarded(callback, topic)
        return self.create_subscription(message_type, topic, guarded, qos, callback_group=group)

    def listen_to_state(self, message_type: type, topic: str, callback: Callable[[Any], None]) -> None:
        """Subscribe to a state: the latched one at the start, and every change, from any publisher.

        A transient local subscription hears no volatile publisher, which `ros2 topic pub` and most programs
        are by default. So there are two; what both hear is taken once.
        """
        heard = "", 0.0

        def take(message: Any) -> None:
            nonlocal heard
            last, heard = heard, (str(message), time.monotonic())  # as text, where NaN is equal to NaN
            if heard[0] != last[0] or heard[1] - last[1] > ECHO:
                callback(message)

        # Without the default callbacks, which would warn of a publisher that the second one hears.
        silent = SubscriptionEventCallbacks(use_default_callbacks=False)
        guarded = self._guarded(take, topic)
        self.create_subscription(message_type, topic, guarded, STATE, event_callbacks=silent)
        self.create_subscription(message_type, topic, guarded, PLAN)

    def every(self, seconds: float, callback: Callable[[], None]) -> Timer:
        """Call back periodically; an error is logged in one line."""
        return self.create_timer(seconds, self._guarded(callback, "timer"))

    def diagnose(self, *statuses: DiagnosticStatus) -> None:
        """Publish on /diagnostics how things are."""
        if self._diagnostics is None:
            self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", PLAN)
        message = DiagnosticArray(status=statuses)
        message.header.stamp = stamp(self.now())
        self._diagnostics.publish(message)

    def errors(self) -> list[str]:
        """What went wrong lately: the last error of each topic."""
        since = time.monotonic() - REMEMBERED
        return [f"{where}: {error}" for where, (error, at) in self._errors.items() if at > since]

    def fail(self, where: str, error: object) -> None:
        """Log an error in one line, and remember it for `errors`."""
        self.get_logger().error(f"{where}: {error}")
        self._errors[where] = str(error), time.monotonic()

    def now(self) -> float:
        """The time of the graph [s since the epoch]."""
        return self.get_clock().now().nanoseconds * 1e-9

    def waits_for(self, what: str) -> None:
        """Say in one line what the node needs before it does anything."""
        self.get_logger().info(f"ready; waits for {what}")

    def _guarded(self, callback: Callable[..., None], where: str) -> Callable[..., None]:
        def guarded(*arguments: Any) -> None:
            try:
                callback(*arguments)
            except GestureBotError as error:
                self.fail(where, error)

        return guarded


class Polled(CallbackGroup):
    """Subscriptions that nothing wakes up for: a message waits until `poll` takes it."""

    def can_execute(self, entity: Any) -> bool:
        """Never."""
        return False

    def beginning_execution(self, entity: Any) -> bool:
        """Never."""
        return False

    def ending_execution(self, entity: Any) -> None:
        """Nothing to do."""


def poll(subscription: Subscription) -> None:
    """Let a subscription of the group Polled take the messages that have come."""
    with subscription.handle:
        while (
            taken := subscription.handle.take_message(subscription.msg_type, subscription.raw)
        ) is not None:
            subscription.callback(taken[0])


def diagnostic(
    name: str,
    troubles: Sequence[str],
    healthy: str,
    level: bytes = DiagnosticStatus.WARN,
    hardware_id: str = "",
    **values: object,
) -> DiagnosticStatus:
    """How one part is.

    Args:
        name: The part.
        troubles: What is wrong with it, in words.
        healthy: What it says where nothing is.
        level: How bad troubles are.
        hardware_id: Which device it is about, such as a port.
        values: Its numbers.
    """
    return DiagnosticStatus(
        name=f"gesture_bot: {name}",
        level=level if troubles else DiagnosticStatus.OK,
        message="; ".join(troubles) or healthy,
        hardware_id=hardware_id,
        values=[KeyValue(key=key, value=str(value)) for key, value in values.items()],
    )


def seconds(time: Any) -> float:
    """A builtin_interfaces/Time or Duration in seconds."""
    return time.sec + time.nanosec * 1e-9


def stamp(moment: float) -> Any:
    """Seconds since the epoch as a builtin_interfaces/Time."""
    return Time(nanoseconds=round(moment * 1e9)).to_msg()
