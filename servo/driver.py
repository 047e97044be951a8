"""The servo driver: from a joint trajectory, through the safety envelope, to the servos and back."""

import contextlib
import itertools
import math
import time
from dataclasses import dataclass, field

import numpy as np

from gesture_bot.base.errors import BusError
from gesture_bot.base.trajectory import JointTrajectory
from gesture_bot.retarget.robot import Robot
from gesture_bot.servo.bus import Bus
from gesture_bot.servo.envelope import Envelope, Interventions
from gesture_bot.servo.models import REGISTERS, WATCHDOG_ERROR, WATCHDOG_UNIT
from gesture_bot.servo.preparation import check_servos, hardware_errors, set_up
from gesture_bot.servo.present import PresentReader
from gesture_bot.servo.table import ServoTable
from gesture_bot.servo.trajectories import Overlay, coast, ease

HEALTH_ADDRESS = REGISTERS["Hardware Error Status"].address
HEALTH_SIZE = REGISTERS["Present Temperature"].address + 1 - HEALTH_ADDRESS
"""One read covers hardware errors, Bus Watchdog, voltage and temperature."""

HEALTH_PERIOD = 1.0
"""Time from looking after one servo to looking after the next [s]."""

EXIT_TIME = 5.0
"""Longest time spent on the way to the rest pose at the end [s]."""

HALF_LIFE = 0.05
"""Half-life of the difference where a trajectory departs from the last one [s]: short, as a stop must be."""

EXIT_SHARE = 0.8
"""Share of the velocity and acceleration limits used on the way to the rest pose at the end."""


@dataclass(frozen=True)
class Feedback:
    """What the servos tell.

    Attributes:
        positions: (j,) [rad].
        velocities: (j,) [rad/s].
        efforts: (j,) [N m], from the motor current or load and the stall torque of the model.
        planned: (j,) where they were to be now [rad]; NaN where nothing is planned, or the robot holds.
        stamp: When they were asked [s since the epoch].
        prompt: Whether they answered so soon that they measured within 4 ms of it.
    """

    positions: np.ndarray
    velocities: np.ndarray
    efforts: np.ndarray
    planned: np.ndarray
    stamp: float
    prompt: bool


@dataclass(frozen=True)
class Health:
    """A servo's state.

    Attributes:
        temperature: [degC].
        voltage: [V].
        errors: The hardware errors it reports.
    """

    temperature: float
    voltage: float
    errors: tuple[str, ...]


@dataclass
class Status:
    """Counts and states since the start, for diagnostics.

    Attributes:
        cycles: Ticks.
        late_cycles: Ticks that came more than half a period late.
        late_answers: Ticks that waited for the servos so long that it is not known when they measured.
        read_failures: Answers that did not come in time or were damaged.
        watchdog_stops: How often the watchdogs had to be armed anew, since the ticks had paused for too
            long, or a servo had missed them or been away.
        silent: Joints whose servo does not answer. While there are any, the robot holds.
        command_age: Time since the last new trajectory [s]; inf before the first.
        interventions: What the envelope held back.
        health: Health by joint, each looked at in turn.
    """

    cycles: int = 0
    late_cycles: int = 0
    late_answers: int = 0
    read_failures: int = 0
    watchdog_stops: int = 0
    silent: tuple[str, ...] = ()
    command_age: float = math.inf
    interventions: Interventions = field(default_factory=Interventions)
    health: dict[str, Health] = field(default_factory=dict)


class Driver:
    """Drives the servos of a robot. It is no thread: its owner calls `tick` at the agreed rate.

    Args:
        robot: Whose servo table, limits, rest pose and bus settings to use.
        port: Path of the serial port.
        rate_hz: How often `tick` is called [1/s].

    Attributes:
        status: Counts and states for diagnostics.

    Raises:
        RobotError: The robot's servo table names an unknown model.
    """

    def __init__(self, robot: Robot, port: str, rate_hz: float = 100.0):
        self.status = Status()
        self._robot = robot
        self._port = port
        self._dt = 1.0 / rate_hz
        self._table = ServoTable(robot)
        self._plan = Overlay(robot.joints, HALF_LIFE)
        self._watchdog = robot.bus.watchdog_ms / 1000
        self._lag = robot.bus.lag_ms / 1000
        self._bus: Bus | None = None
        self._last_tick = -math.inf
        self._sampled = -math.inf
        self._commanded = -math.inf
        self._fresh = False
        self._last_packet = -math.inf
        self._health_turn = itertools.cycle(robot.servos)
        self._next_health = -math.inf

    def start(self) -> None:
        """Open the port, check and set up every servo, and switch torque on where each joint is.

        Raises:
            BusError: The port cannot be opened; a servo is missing, of another model, or not well.
        """
        bus = Bus(self._port, self._robot.bus.baudrate)
        try:
            check_servos(bus, self._robot)
            for servo in self._robot.servos:
                set_up(bus, self._robot, servo)
            self._reader = PresentReader(bus, self._table.ids)
            self._reader.read()
        except BusError:
            bus.close()
            raise
        positions, _, _ = self._table.joint_state(self._reader.present)
        self._envelope = Envelope(self._robot.limits, self._dt, positions)
        self.status.interventions = self._envelope.interventions
        self._bus = bus
        self._arm()
        bus.hurry()

    def set_trajectory(self, trajectory: JointTrajectory) -> None:
        """Follow a trajectory of some or all joints from its first point on.

        Raises:
            InvalidValueError: It is not a trajectory for these joints. What was planned before goes on.
        """
        self._plan.add(trajectory, self._sampled + self._lag)
        self._fresh = True

    def tick(self, now: float) -> Feedback:
        """Send each joint where it is to be now [s since the epoch], and read where it is.

        Raises:
            BusError: The port has vanished.
        """
        self._open_bus()
        begin = time.monotonic()
        self._account(now)
        if now >= self._next_health:
            self._next_health = now + HEALTH_PERIOD
            self._look_after_one()
        # Servos are behind their goals: these are sent so much earlier.
        positions, velocities = self._plan.at(self._sampled + np.array([self._lag, 0.0]))
        if self.status.silent:
            positions = np.full_like(positions, np.nan)
        self._exchange(positions[0], velocities[0])
        measured, speeds, efforts = self._table.joint_state(self._reader.present)
        asked = now + self._reader.read_at - begin
        return Feedback(measured, speeds, efforts, positions[1], asked, self._reader.prompt)

    def close(self) -> None:
        """Leave the servos as the robot's `on_exit` says, and close the port. Does nothing before `start`.

        Raises:
            BusError: The port has vanished.
        """
        bus, on_exit = self._bus, self._robot.bus.on_exit
        if bus is None:
            return
        try:
            if on_exit == "rest_then_off":
                self._go_to_rest()
            if on_exit != "hold":
                bus.set_all(self._table.ids, "Torque Enable", 0)
            bus.set_all(self._table.ids, "Bus Watchdog", 0)
        finally:
            bus.close()
            self._bus = None

    def _account(self, now: float) -> None:
        status = self.status
        status.cycles += 1
        status.late_cycles += math.inf > now - self._last_tick > 1.5 * self._dt
        self._last_tick = now
        # The plan is sampled at even steps that follow the clock slowly: ticks jitter, motion must not.
        due = self._sampled + self._dt
        self._sampled = due + 0.02 * (now - due) if abs(now - due) < self._dt else now
        if self._fresh:
            self._commanded, self._fresh = now, False
        status.command_age = now - self._commanded

    def _exchange(self, positions: np.ndarray, velocities: np.ndarray) -> None:
        """One cycle on the bus: goals out, through the envelope, and the present state in."""
        bus = self._open_bus()
        if time.monotonic() - self._last_packet > self._watchdog:
            self.status.watchdog_stops += 1
            self._arm()
        sent = self._envelope.step(positions, velocities)
        bus.sync_write("Goal Position", self._table.by_id(self._table.ticks(sent)))
        self._last_packet = time.monotonic()
        self._reader.read()
        self.status.late_answers = self._reader.late
        self.status.read_failures = self._reader.failures
        silent = self._reader.silent
        self.status.silent = tuple(servo.joint for servo in self._robot.servos if servo.id in silent)

    def _arm(self) -> None:
        """Clear and arm the servos' watchdogs, and start again from where the joints are."""
        bus = self._open_bus()
        bus.set_all(self._table.ids, "Bus Watchdog", 0)
        self._reader.read()
        positions, _, _ = self._table.joint_state(self._reader.present)
        self._envelope.reset(positions)
        bus.set_all(self._table.ids, "Bus Watchdog", round(self._watchdog / WATCHDOG_UNIT))
        self._last_packet = time.monotonic()

    def _look_after_one(self) -> None:
        """Ask a servo how it is: a silent one if there is any, else each in turn."""
        bus = self._open_bus()
        silent = set(self._reader.silent)
        servo = next(row for row in self._health_turn if not silent or row.id in silent)
        data = bus.try_read(servo.id, HEALTH_ADDRESS, HEALTH_SIZE)
        if not data:
            return
        self.status.health[servo.joint] = Health(
            temperature=_register(data, "Present Temperature"),
            voltage=_register(data, "Present Input Voltage") / 10,
            errors=hardware_errors(_register(data, "Hardware Error Status")),
        )
        if servo.id in silent:
            with contextlib.suppress(BusError):  # it may fall silent again; its next turn comes
                set_up(bus, self._robot, servo)
                self._reader.heard(servo.id)
        if servo.id in silent or _register(data, "Bus Watchdog") == WATCHDOG_ERROR:
            self._last_packet = -math.inf  # the next exchange arms the watchdogs anew

    def _go_to_rest(self) -> None:
        """Move to the rest pose, from whatever motion is under way, in real time."""
        leaving = self._envelope.positions.copy(), self._envelope.velocities.copy()
        rest = self._robot.rest, np.zeros(len(self._robot.rest))
        limits = self._robot.limits
        distance = np.abs(rest[0] - leaving[0])
        # Peaks of a minimum-jerk path: 1.875 distances a duration, 5.774 distances a duration squared.
        duration = max(
            np.max(1.875 * distance / (EXIT_SHARE * limits.velocity)),
            np.sqrt(np.max(5.774 * distance / (EXIT_SHARE * limits.acceleration))),
            self._dt,
        )
        start = time.monotonic()
        for elapsed in np.arange(0.0, EXIT_TIME, self._dt):
            time.sleep(max(start + elapsed - time.monotonic(), 0.0))
            self._exchange(*ease(coast(*leaving, elapsed), rest, elapsed, duration))
            if elapsed > duration and np.allclose(self._envelope.positions, rest[0], atol=1e-3):
                return

    def _open_bus(self) -> Bus:
        if self._bus is None:
            raise BusError("the servo driver is not started")
        return self._bus


def _register(health: bytes, name: str) -> int:
    item = REGISTERS[name]
    start = item.address - HEALTH_ADDRESS
    return int.from_bytes(health[start : start + item.size], "little")
