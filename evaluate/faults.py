"""What the driver makes of faults: each is tried on a virtual bus, and the joints are watched behind it."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from gesture_bot.base.errors import BusError, InvalidValueError
from gesture_bot.base.trajectory import JointTrajectory
from gesture_bot.retarget.robot import Robot
from gesture_bot.servo.driver import Driver
from gesture_bot.servo.simulated_line import SimulatedLine, SimulatedPort
from gesture_bot.servo.status import Status
from gesture_bot.servo.table import ServoTable
from gesture_bot.servo.virtual_bus import servo_specs
from gesture_bot.servo.virtual_servo import VirtualServo
from gesture_bot.servo.virtual_wire import VirtualWire

DT = 0.01
T0 = 1000.0

SWING = 0.5
"""How far all joints swing, to the side where they have more room [rad]."""

FREQUENCY = 0.5
"""How often they do [Hz]."""

BEFORE, LASTING, AFTER = 2.3, 5.0, 10.0
"""How long all is well, until full swing; how long a fault lasts; how long the robot has to come back [s]."""

SETTLING = 3.0
"""So long after a fault began, those that are to stand do [s]."""

NEAR = 0.06
"""A joint this close to its plan follows it [rad]."""

FOLLOWED = 0.5
"""All joints must follow for so long to count as back [s]."""

STANDING = 0.02
"""A joint that moves less than this stands [rad]."""


class Trial:
    """A robot on a virtual bus, in simulated time, all of whose joints swing.

    Args:
        robot: The robot.
        on_fault: As in a robot's file, "stop" or "carry_on".

    Attributes:
        robot: The robot.
        line: The bus.
        servos: The virtual servos, in joint order.
        driver: The driver, started.
        plan: How the joints swing.
    """

    def __init__(self, robot: Robot, on_fault: str):
        # The lag of a virtual servo, so that the joints are where they are planned to be.
        bus = robot.bus.model_copy(update={"on_fault": on_fault, "on_exit": "off", "lag_ms": 45.0})
        self.robot = replace(robot, bus=bus)
        self.line = SimulatedLine(VirtualWire(map(VirtualServo, servo_specs(robot))), bus.baudrate)
        self.servos = [self.line.wire.servos[row.id] for row in robot.servos]
        self.driver = Driver(self.robot, SimulatedPort(self.line), 1.0 / DT)
        self.driver.start()
        self._began = self._due = self.line.clock.monotonic()
        self.plan = _swing(robot)
        self.driver.set_trajectory(self.plan)

    @property
    def elapsed(self) -> float:
        """Time since the start [s]."""
        return self.line.clock.monotonic() - self._began

    def tick(self) -> None:
        """One cycle, when it is due.

        Raises:
            BusError: The port has vanished.
        """
        clock = self.line.clock
        clock.sleep(max(self._due - clock.monotonic(), 0.0))
        self._due = max(self._due + DT, clock.monotonic())
        self.driver.tick(T0 + self.elapsed)

    def angles(self) -> np.ndarray:
        """(j,) where the joints really are [rad]."""
        ticks = np.array([servo.position for servo in self.servos])
        return ServoTable(self.robot).positions(ticks)

    def planned(self) -> np.ndarray:
        """(j,) where they should be [rad]."""
        return self.plan.at(T0 + self.elapsed)[0]

    def state(self) -> np.ndarray:
        """(1 + j,) the time [s] and the angles [rad]."""
        return np.array([self.elapsed, *self.angles()])

    def off_plan(self) -> np.ndarray:
        """(j,) how far they are from there [rad]."""
        return np.abs(self.angles() - self.planned())


def _swing(robot: Robot) -> JointTrajectory:
    limits, rest = robot.limits, robot.rest
    times = np.arange(0.0, BEFORE + LASTING + AFTER + 2.0, 0.02)
    phase = 2.0 * np.pi * FREQUENCY * times[:, None]
    up, down = limits.upper - rest, rest - limits.lower
    size = 0.5 * np.where(up >= down, np.minimum(up, SWING), -np.minimum(down, SWING))
    positions = rest + size * (1.0 - np.cos(phase))
    return JointTrajectory(
        robot.joints, T0 + times, positions, 2.0 * np.pi * FREQUENCY * size * np.sin(phase)
    )


FAULTY = 3
"""The joint that faults of one servo are about: an elbow of toa."""

NOBODY, ONE, CABLE, ALL = slice(0, 0), slice(FAULTY, FAULTY + 1), slice(0, 5), slice(None)
"""Joints that a fault takes: the servos on one cable are the first five."""


@dataclass(frozen=True)
class Fault:
    """A fault, and what the robot must do.

    Attributes:
        duty: What it must do, in words.
        begin: Makes the fault.
        end: Ends it.
        noticed: Whether the driver tells of it.
        within: It must do so in this time [s].
        taken: These joints must stand while it lasts.
        stops: Whether the others stop, too, where the robot's file says so. They carry on otherwise.
        lasting: How long it lasts [s]; what the joints do meanwhile is looked at if that is over SETTLING.
    """

    duty: str
    begin: Callable[[Trial], object]
    end: Callable[[Trial], object]
    noticed: Callable[[Status], bool]
    within: float
    taken: slice
    stops: bool = False
    lasting: float = LASTING


@dataclass(frozen=True)
class Outcome:
    """How a fault went.

    Attributes:
        failures: What the robot did not do that it must; empty if it survived.
        seconds: Time until the fault was told of [s].
        back: Time from its end until all joints followed their plan again [s].
        fastest: Largest speed of a joint from the fault on, as a share of its limit.
    """

    failures: tuple[str, ...]
    seconds: float
    back: float
    fastest: float


def _wire(**faults: object) -> Callable[[Trial], object]:
    return lambda trial: vars(trial.line.wire.faults).update(faults)


def _servo(**state: object) -> Callable[[Trial], object]:
    return lambda trial: vars(trial.servos[FAULTY]).update(state)


def _line(connected: bool) -> Callable[[Trial], object]:
    return lambda trial: setattr(trial.line, "connected", connected)


def _pull_cable(trial: Trial) -> None:
    for servo in trial.servos[CABLE]:
        servo.power = False


def _plug_cable(trial: Trial) -> None:
    for servo in trial.servos[CABLE]:
        servo.reboot()


def _push(trial: Trial) -> None:
    servo = trial.servos[FAULTY]
    servo.position += 0.4 * servo.model.ticks_per_radian
    servo.stuck = True


def _fall_silent(trial: Trial) -> None:
    trial.line.wire.faults.silent.add(trial.robot.servos[FAULTY].id)


def _noise(share: float, duty: str, noticed: Callable[[Status], bool], taken: slice) -> Fault:
    return Fault(duty, _wire(bit_noise=share), _wire(bit_noise=0.0), noticed, 1.0, taken)


def _some_reads_fail(status: Status) -> bool:
    return status.read_failures > 0


def _one_is_silent(status: Status) -> bool:
    return len(status.silent) > 0


def _one_yields(status: Status) -> bool:
    return len(status.yielding) > 0


FAULTS = {
    "bit noise 0.1%": _noise(0.001, "goes on, and counts what is damaged", _some_reads_fail, NOBODY),
    "bit noise 1%": _noise(0.01, "hears nobody: all joints stand", _one_is_silent, ALL),
    "bit noise 10%": _noise(0.1, "hears nobody: all joints stand", _one_is_silent, ALL),
    "lost replies 20%": Fault(
        "goes on, and counts what is lost",
        _wire(lost_replies=0.2),
        _wire(lost_replies=0.0),
        _some_reads_fail,
        0.3,
        NOBODY,
    ),
    "silent servo": Fault(
        "its joint stands; the others as configured; back, it is set up again and eased in",
        _fall_silent,
        lambda trial: trial.line.wire.faults.silent.clear(),
        _one_is_silent,
        0.3,
        ONE,
        stops=True,
    ),
    "power dip of a servo": Fault(
        "the servo is found limp, set up again, and its joint starts from where it is",
        lambda trial: trial.servos[FAULTY].reboot(),
        lambda trial: None,
        lambda status: len(status.out) > 0,
        1.5,
        NOBODY,
        lasting=0.0,
    ),
    "stuck joint": Fault(
        "its goal goes to where it is, and is tried again slowly every 2 s; the others carry on",
        _servo(stuck=True),
        _servo(stuck=False),
        _one_yields,
        0.3,
        ONE,
    ),
    "pushed joint": Fault("as a stuck joint", _push, _servo(stuck=False), _one_yields, 0.3, ONE),
    "over-temperature": Fault(
        "its joint goes to rest slowly and off until it has cooled; the others as configured",
        _servo(temperature=70.0),
        _servo(temperature=40.0),
        lambda status: len(status.warm) > 0,
        2.0,
        ONE,
        stops=True,
    ),
    "pulled cable": Fault(
        "the joints behind it are limp; the others as configured; plugged in, all are set up again",
        _pull_cable,
        _plug_cable,
        lambda status: len(status.silent) == 5,
        0.5,
        CABLE,
        stops=True,
    ),
    "vanished port": Fault(
        "the servos stop by their watchdogs; the port is opened again when it is back",
        _line(connected=False),
        _line(connected=True),
        lambda status: status.ports_lost > 0,
        0.1,
        ALL,
    ),
}
"""By name."""


def try_fault(robot: Robot, name: str, on_fault: str = "stop") -> Outcome:
    """Let a robot swing, make a fault, end it, and see that the robot does all that it must.

    Args:
        robot: A robot with more than five joints.
        name: One of FAULTS.
        on_fault: As in a robot's file, "stop" or "carry_on".

    Raises:
        InvalidValueError: No fault has this name.
    """
    if name not in FAULTS:
        raise InvalidValueError("no such fault", name, FAULTS)
    fault, trial = FAULTS[name], Trial(robot, on_fault)
    while trial.elapsed < BEFORE:
        trial.tick()
    failures = ["the joints did not follow before it"] if trial.off_plan().max() > NEAR else []
    fault.begin(trial)
    begun, seconds, path = trial.elapsed, np.inf, [trial.state()]

    def cycle() -> None:
        nonlocal seconds
        with suppress(BusError):  # the node, too, goes on when the port has vanished
            trial.tick()
        path.append(trial.state())
        if seconds == np.inf and fault.noticed(trial.driver.status):
            seconds = trial.elapsed - begun

    while trial.elapsed < begun + fault.lasting:
        cycle()
    if fault.lasting > SETTLING:
        stands = ALL if fault.stops and on_fault == "stop" else fault.taken
        failures += _undone(trial, np.array([state for state in path if state[0] > begun + SETTLING]), stands)
    fault.end(trial)
    ended = followed = trial.elapsed
    while trial.elapsed < min(followed + FOLLOWED, ended + AFTER):
        cycle()
        if trial.off_plan().max() > NEAR:
            followed = trial.elapsed
    if trial.elapsed < followed + FOLLOWED:
        failures.append(f"the joints did not follow again within {AFTER:g} s")
    if seconds > fault.within:
        failures.append(f"it was not told of within {fault.within:g} s")
    steps = np.diff(path, axis=0)
    fastest = float(np.max(np.abs(steps[:, 1:]) / np.maximum(steps[:, :1], 1e-3) / robot.limits.velocity))
    if fastest > 1.05:
        failures.append(f"a joint moved at {fastest:.2f} of its limit")
    return Outcome(tuple(failures), seconds, followed - ended, fastest)


def _undone(trial: Trial, states: np.ndarray, stands: slice) -> list[str]:
    """Which joints moved that must stand, or stood that must carry on."""
    joints, moved = np.array(trial.robot.joints), np.ptp(states[:, 1:], axis=0)
    must_stand = np.zeros(len(joints), bool)
    must_stand[stands] = True
    stood = moved < 0.8 * np.ptp(trial.plan.positions, axis=0)
    return [
        *(f"{joint} moved" for joint in joints[must_stand & (moved > STANDING)]),
        *(f"{joint} did not carry on" for joint in joints[~must_stand & stood]),
    ]
