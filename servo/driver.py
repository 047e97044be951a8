"""The servo driver: from a joint trajectory, through the safety envelope, to the servos and back."""

import math
from collections.abc import Mapping

import numpy as np

from gesture_bot.base.errors import BusError, PortError
from gesture_bot.base.trajectory import JointTrajectory
from gesture_bot.retarget.robot import Robot
from gesture_bot.servo.bus import Port
from gesture_bot.servo.buses import RobotBus, open_bus, read_ports
from gesture_bot.servo.collision_guard import CollisionGuard
from gesture_bot.servo.envelope import Envelope
from gesture_bot.servo.following import Following
from gesture_bot.servo.models import WATCHDOG_UNIT
from gesture_bot.servo.pacing import Pacing
from gesture_bot.servo.precautions import Precautions
from gesture_bot.servo.preparation import check_servos, set_up
from gesture_bot.servo.present import PresentReader
from gesture_bot.servo.status import Feedback, Status
from gesture_bot.servo.table import ServoTable, series_of
from gesture_bot.servo.trajectories import Overlay, coast, ease, easing_time
from gesture_bot.servo.upkeep import Upkeep

EXIT_TIME = 5.0
"""Longest time spent on the way to the rest pose at the end [s]."""

HALF_LIFE = 0.05
"""Half-life of the difference where a trajectory departs from the last one [s]: short, as a stop must be."""

EXIT_SHARE = 0.8
"""Share of the velocity and acceleration limits used on the way to the rest pose at the end."""

REOPEN_PERIOD = 0.5
"""Time from one try to open a port that has vanished to the next [s]."""


class Driver:
    """Drives the servos of a robot. It is no thread: its owner calls `tick` at the agreed rate.

    Args:
        robot: Whose servo table, limits, rest pose and bus settings to use.
        port: Path of the serial port, or of each bus as `read_ports` takes it; or ports of another kind, by
            the names of the buses.
        rate_hz: How often `tick` is called [1/s].

    Attributes:
        active: Whether trajectories are followed.
        stopped: True from `stop` to `reset`.
        status: Counts and states for diagnostics.
        clock: Tells the time; on a simulated bus, the simulated time.

    Raises:
        RobotError: The robot's servo table names an unknown model, or models of several series on one bus.
        InvalidValueError: The text of ports does not fit the robot's buses; lists their names.
    """

    def __init__(self, robot: Robot, port: str | Port | Mapping[str, Port], rate_hz: float = 100.0):
        self.active = True
        self.stopped = False
        self.status = Status()
        self._robot = robot
        series_of(robot)
        if isinstance(port, str):
            port = {name: Port(path) for name, path in read_ports(port, robot).items()}
        self._ports = {"": port} if isinstance(port, Port) else dict(port)
        self.clock = next(iter(self._ports.values())).clock
        self._dt = 1.0 / rate_hz
        self._table = ServoTable(robot)
        self._plan = Overlay(robot.joints, HALF_LIFE)
        self._watchdog = robot.bus.watchdog_ms / 1000
        self._lag = robot.bus.lag_ms / 1000
        self._bus: RobotBus | None = None
        self._lost_port = ""
        self._next_open = -math.inf
        self._pacing = Pacing(self._dt)
        self._commanded = -math.inf
        self._fresh = False
        self._last_packet = -math.inf

    def start(self) -> None:
        """Open the port, check and set up every servo, and switch torque on where each joint is.

        Raises:
            BusError: The port cannot be opened; a servo is missing, of another model, or not well.
        """
        bus = open_bus(self._robot, self._ports)
        self.status.latency_timer = bus.latency_timer
        try:
            check_servos(bus, self._robot)
            for servo in self._robot.servos:
                set_up(bus.of(servo.id), self._robot, servo)
            self._reader = PresentReader(bus, self._table.ids)
            self._reader.read_all()
        except BusError:
            bus.close()
            raise
        positions, _, _ = self._table.joint_state(self._reader.present)
        guard = CollisionGuard(self._robot, self._dt)
        self._envelope = Envelope(self._robot.limits, self._dt, positions, guard)
        self._envelope.interventions = self.status.interventions
        self._upkeep = Upkeep(bus, self._robot, self._reader)
        self._following = Following(self._robot, self._dt)
        self._precautions = Precautions(self._robot, self._dt, self._envelope, self._upkeep, self._following)
        self._bus, self._lost_port = bus, ""
        self._arm()
        bus.hurry()

    def set_trajectory(self, trajectory: JointTrajectory) -> None:
        """Follow a trajectory of some or all joints from its first point on.

        Raises:
            InvalidValueError: It is not a trajectory for these joints. What was planned before goes on.
        """
        self._plan.add(trajectory, self._pacing.sampled + self._lag)
        self._fresh = True

    def activate(self) -> None:
        """Follow what is planned from now on; joints approach it slowly. So it is at the start."""
        self._plan = Overlay(self._robot.joints, HALF_LIFE)
        self.active = True

    def deactivate(self) -> None:
        """Let all joints brake and hold, whatever is planned, until `activate`."""
        self.active = False

    def stop(self) -> None:
        """Let all joints brake, whatever is planned, and hold or relax as the robot's `on_stop` says."""
        self.stopped = True

    def reset(self) -> None:
        """Follow what is planned, from wherever the joints are now; they approach it slowly."""
        self.stopped = False

    def tick(self, now: float, since: float | None = None) -> Feedback:
        """Send each joint where it is to be now, and read where it is.

        A port that has vanished is opened again when it is back; the joints start from where they are.

        Args:
            now: The time [s since the epoch].
            since: A moment just before that was asked for, on the monotonic clock [s]; None: now. The thread
                may pause behind it, and stamps are right all the same.

        Raises:
            PortError: The port has vanished.
            BusError: The port is back, but the robot cannot be started.
        """
        if self._lost_port:
            if self.clock.monotonic() < self._next_open:
                raise PortError("the serial port has vanished", self._lost_port)
            self._next_open = self.clock.monotonic() + REOPEN_PERIOD
            self.start()
        try:
            return self._cycle(now, since)
        except PortError as error:
            self._lose_port(str(error.value))
            raise

    def close(self) -> None:
        """Leave the servos as the robot's `on_exit` says, and close the port. Does nothing before `start`.

        A stop latches: stopped joints do not go to rest first.

        Raises:
            BusError: The port has vanished.
        """
        if self._lost_port:
            raise PortError("the serial port has vanished", self._lost_port)
        bus, on_exit = self._bus, self._robot.bus.on_exit
        if bus is None:
            return
        try:
            if on_exit == "rest_then_off" and not self.stopped:
                self._go_to_rest()
            if on_exit != "hold":
                bus.set_all(self._table.ids, "Torque Enable", 0)
            bus.set_all(self._table.ids, "Bus Watchdog", 0)
        finally:
            bus.close()
            self._bus = None

    def _cycle(self, now: float, since: float | None) -> Feedback:
        self._open_bus()
        clock, status, reader = self.clock, self.status, self._reader
        status.cycles += 1
        until = clock.monotonic()
        self._pacing.tick(now, until if since is None else since, until)
        if self._fresh:
            self._commanded, self._fresh = now, False
        self._upkeep.step(clock.monotonic())
        # Servos are behind their goals: these are sent so much earlier.
        positions, velocities = self._plan.at(self._pacing.sampled + np.array([self._lag, 0.0]))
        precautions, stopped = self._precautions, self.stopped
        asked = precautions.asked(positions[0], velocities[0], self.active, stopped, clock.monotonic())
        self._exchange(*asked)
        measured, speeds, efforts = self._table.joint_state(reader.present)
        precautions.observe(measured, efforts, reader.fresh, stopped, clock.monotonic())
        precautions.tell(status)
        status.command_age = now - self._commanded
        status.late_cycles = self._pacing.late
        status.late_answers, status.read_failures = reader.late, reader.failures
        planned = np.where(precautions.unplanned(), np.nan, positions[1])
        prompt = reader.prompt and bool((reader.fresh | self._upkeep.out).all())
        return Feedback(measured, speeds, efforts, planned, self._pacing.stamp(reader.read_at), prompt)

    def _exchange(self, positions: np.ndarray, velocities: np.ndarray) -> None:
        """One cycle on the bus: goals out, through the envelope, and the present state in."""
        bus = self._open_bus()
        if self.clock.monotonic() - self._last_packet > self._watchdog:
            self.status.watchdog_stops += 1
            self._arm()
        sent = self._envelope.step(positions, velocities, self._upkeep.heat.speed)
        goals = self._table.by_id(self._table.ticks(sent))
        used = zip(self._table.ids, ~self._upkeep.out, strict=True)
        bus.sync_write("Goal Position", {servo_id: goals[servo_id] for servo_id, on in used if on})
        self._last_packet = self.clock.monotonic()
        self._reader.read()

    def _arm(self) -> None:
        """Clear and arm the servos' watchdogs, and start again from where the joints are."""
        bus = self._open_bus()
        used = [servo_id for servo_id, out in zip(self._table.ids, self._upkeep.out, strict=True) if not out]
        bus.set_all(used, "Bus Watchdog", 0)
        self._reader.read()
        positions, _, _ = self._table.joint_state(self._reader.present)
        self._envelope.reset(np.where(self._reader.fresh, positions, self._envelope.positions))
        bus.set_all(used, "Bus Watchdog", round(self._watchdog / WATCHDOG_UNIT))
        self._last_packet = self.clock.monotonic()

    def _lose_port(self, port: str) -> None:
        """Close all ports: what a bus does without the other would be no motion that was planned."""
        self.status.ports_lost += 1
        self._open_bus().close()
        self._bus, self._lost_port = None, port
        self._next_open = self.clock.monotonic() + REOPEN_PERIOD

    def _go_to_rest(self) -> None:
        """Move to the rest pose, from whatever motion is under way, in real time."""
        leaving = self._envelope.positions.copy(), self._envelope.velocities.copy()
        rest = self._robot.rest, np.zeros(len(self._robot.rest))
        limits = self._robot.limits
        distance = rest[0] - leaving[0]
        durations = easing_time(
            distance, 0.0 * distance, EXIT_SHARE * limits.velocity, EXIT_SHARE * limits.acceleration
        )
        duration = max(durations.max(), self._dt)
        start = self.clock.monotonic()
        for elapsed in np.arange(0.0, EXIT_TIME, self._dt):
            self.clock.sleep(max(start + elapsed - self.clock.monotonic(), 0.0))
            path = ease(coast(*leaving, elapsed), rest, elapsed, duration)
            self._exchange(*self._following.soften(*path))
            if elapsed > duration and np.allclose(self._envelope.positions, rest[0], atol=1e-3):
                return

    def _open_bus(self) -> RobotBus:
        if self._bus is None:
            raise BusError("the servo driver is not started")
        return self._bus
