"""The last node before the robot: trajectories in, servo packets out, measured joint states back."""

import sys
import threading
import time
import traceback
from collections import deque
from contextlib import ExitStack, suppress
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from gesture_bot.base.errors import BusError, GestureBotError, InvalidValueError
from gesture_bot.evaluate.lag import SHIFTS, motion_lag
from gesture_bot.msg import JointOwners
from gesture_bot.nodes.managed import ManagedNode
from gesture_bot.nodes.messages import trajectory_from
from gesture_bot.nodes.node import PLAN, STATE, diagnostic, stamp
from gesture_bot.nodes.urgent import UrgentNode
from gesture_bot.retarget.robot import Robot, load_robot
from gesture_bot.servo.arbitration import STOP
from gesture_bot.servo.driver import Driver
from gesture_bot.servo.status import Feedback
from gesture_bot.servo.virtual_bus import PHYSICS, VirtualBus

LOOKED_AT = 3.0
"""The lag is that of so many last seconds [s]."""

RCLError = rclpy_implementation.RCLError


class ServoDriver(ManagedNode):
    """Runs the servo bus in a thread of its own, so that no other node of the process makes it wait.

    Inactive, it holds the joints where they are and takes no trajectories; torque stays on, and joint states
    are published. Unconfigured, the port is closed.
    """

    def __init__(self, name: str = "servo_driver", **options: Any):
        super().__init__(name, **options)
        robot = load_robot(self.parameter("robot", "toa", "Robot: a name in config/robots, or a YAML file"))
        port = self.parameter(
            "port",
            "virtual",
            "Serial port of the servo bus; of several, 'left=PORT right=PORT'; or 'virtual' (simulated)",
        )
        rate = self.parameter("rate", 100.0, "Bus cycles a second [Hz]", bounds=(50.0, 500.0))
        physics = self.parameter(
            "physics",
            PHYSICS[0],
            "What moves the joints of the virtual bus: first_order, or mujoco (gravity, inertia, torque)",
            choices=PHYSICS,
        )
        self._joints = list(robot.joints)
        self._models = {servo.joint: f"{servo.model}, ID {servo.id}" for servo in robot.servos}
        self._states = self.create_publisher(JointState, "joint_states", PLAN)
        self._resources = ExitStack()
        if port == "virtual":
            port = self._virtual_bus(robot, physics).port
        self._port = port
        self._driver = Driver(robot, port, rate)
        self._period = 1.0 / rate
        self._recent: deque[Feedback] = deque(maxlen=round(LOOKED_AT * rate))
        self._trouble, self._faults = "", list[str]()
        self._stopping = threading.Event()
        self._loop: threading.Thread | None = None
        self.listen(JointTrajectory, "joint_trajectory", self._on_trajectory, PLAN)
        self.every(1.0, self._report)
        self.bring_up()
        self._urgent = UrgentNode(self)
        owners = self.resolve_topic_name("motion_mux/owners")
        self._urgent.listen(JointOwners, owners, self._on_owners, STATE)
        self.waits_for("joint_trajectory; holds until then")

    def configure(self) -> None:
        """Open the port, and hold the joints where they are.

        Raises:
            BusError: The port cannot be opened, or a servo is not as it should be.
        """
        self._driver.deactivate()
        self._driver.start()
        self._recent.clear()
        self._faults = []
        # Python lets another thread go on for 5 ms before it takes turns: half a bus cycle, too long.
        sys.setswitchinterval(5e-4)
        self._stopping.clear()
        self._loop = threading.Thread(target=self._run, daemon=True)
        self._loop.start()

    def activate(self) -> None:
        """Follow trajectories."""
        self._driver.activate()

    def deactivate(self) -> None:
        """Follow none; hold."""
        self._driver.deactivate()

    def cleanup(self) -> None:
        """Bring the robot to rest, treat the servos' torque as the robot's file says, and close the port."""
        if self._loop:
            self._stopping.set()
            self._loop.join()
            self._loop = None
        try:
            self._driver.close()
        except BusError as error:
            self.get_logger().error(str(error))

    def destroy_node(self) -> None:
        """Give the servos back, and end the virtual bus."""
        self._urgent.destroy_node()
        super().destroy_node()
        self._resources.close()

    def _virtual_bus(self, robot: Robot, physics: str) -> VirtualBus:
        """A virtual bus, whose faults are a parameter that may be set at any time."""
        bus = self._resources.enter_context(VirtualBus(robot, physics))
        description = "Faults of the virtual bus, such as 'bit_noise=0.01 silent=14,15'; '' is none"
        self.declare_parameter("virtual_fault", "", ParameterDescriptor(description=description))

        def take(parameters: list[Parameter]) -> SetParametersResult:
            try:
                for parameter in parameters:
                    if parameter.name == "virtual_fault":
                        bus.inject(parameter.value)
            except (InvalidValueError, OSError) as error:
                return SetParametersResult(successful=False, reason=str(error))
            return SetParametersResult(successful=True)

        bus.inject(self.get_parameter("virtual_fault").value)
        self.add_on_set_parameters_callback(take)
        return bus

    def _run(self) -> None:
        due = time.monotonic()
        while not self._stopping.wait(max(0.0, due - time.monotonic())):
            try:
                since = time.monotonic()
                feedback = self._driver.tick(self.now(), since)
            except Exception as error:  # whatever it is, the next cycle may go well
                self._trouble = str(error) or repr(error)
                text = self._trouble if isinstance(error, GestureBotError) else traceback.format_exc()
                self.get_logger().error(text, throttle_duration_sec=1.0)
            else:
                self._trouble = ""
                # A state whose moment is not known would look like a jump, or an old one of a joint.
                if feedback.prompt:
                    self._recent.append(feedback)
                    with suppress(RCLError):  # the graph may end between two cycles
                        self._publish(feedback)
            # A late cycle is not made up for: the next one is due a period from now.
            due = max(due + self._period, time.monotonic())

    def _publish(self, feedback: Feedback) -> None:
        state = JointState(
            name=self._joints,
            position=feedback.positions.tolist(),
            velocity=feedback.velocities.tolist(),
            effort=feedback.efforts.tolist(),
        )
        state.header.stamp = stamp(feedback.stamp)
        self._states.publish(state)

    def _lag(self) -> str:
        """How far the joints have been behind the plan lately [ms]; empty where they stood still."""
        recent = list(self._recent)[::4]
        times = np.array([feedback.stamp for feedback in recent])
        planned = np.array([feedback.planned for feedback in recent])
        if not len(recent) or np.isnan(planned).any():
            return ""
        inside = (times > times[0] + SHIFTS[-1]) & (times < times[-1] + SHIFTS[0])
        measured = np.array([feedback.positions for feedback in recent])
        lag = motion_lag(times[inside], measured[inside], times, planned) if inside.any() else None
        return "" if lag is None else f"{1000 * lag:.0f}"

    def _on_trajectory(self, message: JointTrajectory) -> None:
        if self.state == "active":
            self._driver.set_trajectory(trajectory_from(message, self.now()))

    def _on_owners(self, message: JointOwners) -> None:
        """Know of a stop as well as the mux, which latches it: until its reset, no trajectory is followed."""
        if message.owners and set(message.owners) == {STOP}:
            self._driver.stop()
        else:
            self._driver.reset()

    def _report(self) -> None:
        if self.state not in ("inactive", "active"):
            closed = [f"{self.state}: the port is closed"]
            self.diagnose(diagnostic("servo bus", closed, "running", hardware_id=self._port))
            return
        status = self._driver.status
        held = status.interventions
        faults = [f"{joint} {reason}" for joint, reason in status.out.items()]
        self._log(faults)
        troubles = [self._trouble] if self._trouble else []
        troubles += faults
        level = DiagnosticStatus.ERROR if troubles else DiagnosticStatus.WARN
        troubles += [f"{joint} is blocked, and yields" for joint in status.yielding]
        troubles += [f"{joint} is held, or the robot would touch itself" for joint in status.kept_off]
        if status.latency_timer and status.latency_timer > 1:
            troubles.append(f"the USB adapter keeps answers back for {status.latency_timer} ms")
        bus = diagnostic(
            "servo bus",
            [*troubles, *self._standing()],
            "running",
            level=level,
            hardware_id=self._port,
            cycles=status.cycles,
            late_cycles=status.late_cycles,
            late_answers=status.late_answers,
            read_failures=status.read_failures,
            watchdog_stops=status.watchdog_stops,
            ports_lost=status.ports_lost,
            blocked_joints=status.blocks,
            lag_ms=self._lag(),
            held_back_position=held.position,
            held_back_velocity=held.velocity,
            held_back_acceleration=held.acceleration,
            held_back_collision=held.collision,
        )
        servos = [
            diagnostic(
                f"servo {joint}",
                health.errors or (("warm",) if joint in status.warm else ()),
                "healthy",
                level=DiagnosticStatus.ERROR if health.errors else DiagnosticStatus.WARN,
                hardware_id=self._models[joint],
                temperature_degc=health.temperature,
                voltage_v=health.voltage,
                load_percent=round(100 * health.load),
            )
            for joint, health in list(status.health.items())
        ]
        self.diagnose(bus, *servos)

    def _log(self, faults: list[str]) -> None:
        """Tell each fault of a servo once in the log, too, and that all are over."""
        for fault in faults:
            if fault not in self._faults:
                self.get_logger().error(fault)
        if self._faults and not faults and not self._driver.status.relaxed:
            self.get_logger().info("all servos are in service again")
        self._faults = faults

    def _standing(self) -> list[str]:
        """Why the robot as a whole does not move, if so."""
        if self._driver.status.relaxed:
            return ["relaxed: hands can move the joints"]
        if self._driver.stopped:
            return ["stopped until `reset`"]
        if self.state != "active":
            return [f"{self.state}: the joints hold, and trajectories are not followed"]
        return ["the robot holds"] if self._driver.status.holding else []
