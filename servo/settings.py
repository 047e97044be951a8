"""What a robot needs its servos to be set to, and setting them so."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

from gesture_bot.base.errors import BusError
from gesture_bot.retarget.robot import Robot, ServoEntry
from gesture_bot.servo.bus import Bus
from gesture_bot.servo.buses import RobotBus
from gesture_bot.servo.models import find_model, model_name, signed
from gesture_bot.servo.preparation import SETTINGS, hardware_errors
from gesture_bot.servo.scan import SHARED
from gesture_bot.servo.table import ServoTable

SILENT = "does not answer: `gesture-bot servos scan` finds servos with other IDs and baud rates"

SHUTDOWN = 1 << 2 | 1 << 4 | 1 << 5
"""Shutdown (63): torque goes off when the servo is too hot, gets an electrical shock, or is overloaded."""

NO_SECOND_ID = 253
"""Secondary(Shadow) ID (12): from here on, there is none."""

DRIVE_MODES = {0: "reverse", 1: "follower", 2: "time-based", 3: "torque by goal"}
"""Bits of Drive Mode (10). With time-based profiles, Profile Velocity, a joint's last limit, is a time."""

MARGIN = math.radians(5.0)
"""Position limits lie so far outside the joint's range [rad]: a joint that hangs against its stop may stand a
little beyond it, and the goal must be there when torque comes on."""


@dataclass(frozen=True)
class Change:
    """A register that is not as it should be.

    Attributes:
        register: Its name.
        value: What it holds.
        wanted: What it should hold.
    """

    register: str
    value: int
    wanted: int

    @property
    def meaning(self) -> str:
        """What the bits of Drive Mode (10) that are set stand for; empty for any other register."""
        bits = self.value if self.register == "Drive Mode" else 0
        return ", ".join(name for bit, name in DRIVE_MODES.items() if bits & 1 << bit)


@dataclass(frozen=True)
class Inspection:
    """What was found out about one servo.

    Attributes:
        servo: Its row of the servo table.
        firmware: Firmware version, 0 where it does not answer.
        changes: Registers that should hold something else.
        problems: What no register can put right, for people.
    """

    servo: ServoEntry
    firmware: int = 0
    changes: tuple[Change, ...] = ()
    problems: tuple[str, ...] = ()


def inspect(bus: Bus, robot: Robot, servo: ServoEntry) -> Inspection:
    """Compare a servo with what the robot needs.

    Raises:
        BusError: It answers, and then stops to.
    """
    if not bus.is_clear(servo.id):
        return Inspection(servo, problems=(SHARED if servo.id in bus.scan() else SILENT,))
    number, firmware = bus.read(servo.id, "Model Number"), bus.read(servo.id, "Firmware Version")
    model = find_model(servo.model)
    if number != model.number:
        problem = f"is of the model {model_name(number)}, and the robot's file says {servo.model}"
        return Inspection(servo, firmware, problems=(problem,))
    problems = [f"reports {error}" for error in hardware_errors(bus.read(servo.id, "Hardware Error Status"))]
    if firmware < (needed := model.series.watchdog_firmware):
        problems.append(f"has no watchdog: it comes with firmware {needed}. Update it")
    homing = read_homing(bus, servo.id)
    if abs(homing) > (most := model.homing_range):
        problems.append(f"ignores its Homing Offset of {homing}, more than {most}: calibrate it")
    lowest, highest = joint_ends(robot, servo)
    if lowest < model.first or highest > model.last:
        turns = f"turns from {model.first} to {model.last}"
        problems.append(f"{turns}; the joint needs {lowest} to {highest}: change its offset")
    elif not fits_turn(robot, servo, homing):
        problems.append(f"passes the end of its turn within the joint's range, at Homing Offset {homing}")
    changes = []
    for register, wanted in _wanted(bus, robot, servo).items():
        value = _read(bus, servo.id, register)
        if value != wanted:
            changes.append(Change(register, value, wanted))
    return Inspection(servo, firmware, tuple(changes), tuple(problems))


def apply(bus: Bus, servo: ServoEntry, changes: Iterable[Change]) -> None:
    """Make changes to a servo, whose torque must be off, and see that they are made.

    Raises:
        BusError: The servo does not answer, or refuses.
    """
    for change in changes:
        bus.write(servo.id, change.register, change.wanted)
        if (value := _read(bus, servo.id, change.register)) != change.wanted:
            raise BusError(f"servo {servo.id} of {servo.joint} keeps {change.register} at", value)


def with_torque(bus: RobotBus, ids: Iterable[int]) -> list[int]:
    """Those of some servos that have torque on; one that does not answer has not.

    While torque is on, the EEPROM registers (below 64) cannot be written.
    """

    def powered(servo_id: int) -> bool:
        own = bus.of(servo_id)
        torque = own.registers["Torque Enable"]
        return any(own.try_read(servo_id, torque.address, torque.size))

    return [servo_id for servo_id in ids if powered(servo_id)]


def read_homing(bus: Bus, servo_id: int) -> int:
    """Homing Offset (20) of a servo [ticks]: position = that of the encoder + this.

    Raises:
        BusError: It does not answer.
    """
    return _read(bus, servo_id, "Homing Offset")


def joint_ends(robot: Robot, servo: ServoEntry) -> tuple[int, int]:
    """Least and largest position of a servo within its joint's range [ticks]."""
    joint = robot.joints.index(servo.joint)
    table = ServoTable(robot)
    lower, upper = (int(table.ticks(ends)[joint]) for ends in (robot.limits.lower, robot.limits.upper))
    return min(lower, upper), max(lower, upper)


def fits_turn(robot: Robot, servo: ServoEntry, homing: int) -> bool:
    """Whether the encoder stays within its turn over the joint's whole range, with a Homing Offset [ticks].

    Otherwise, where the servo is switched on beyond the end, its position is a turn off.
    """
    lowest, highest = joint_ends(robot, servo)
    model = find_model(servo.model)
    return model.first <= lowest - homing and highest - homing <= model.last


def _read(bus: Bus, servo_id: int, register: str) -> int:
    """A register's value; those of four bytes are signed."""
    value, size = bus.read(servo_id, register), bus.registers[register].size
    return signed(value, size) if size == 4 else value


def _wanted(bus: Bus, robot: Robot, servo: ServoEntry) -> dict[str, int]:
    """What the registers of a servo should hold."""
    lowest, highest = joint_ends(robot, servo)
    model = find_model(servo.model)
    margin = round(MARGIN * model.ticks_per_radian)
    velocity = robot.limits.velocity[robot.joints.index(servo.joint)]
    fastest = math.ceil(velocity / model.series.velocity_unit)
    return {
        **SETTINGS,
        "Secondary(Shadow) ID": max(bus.read(servo.id, "Secondary(Shadow) ID"), NO_SECOND_ID),
        "Shutdown": bus.read(servo.id, "Shutdown") | SHUTDOWN,
        "Velocity Limit": max(bus.read(servo.id, "Velocity Limit"), fastest),
        "Min Position Limit": min(max(lowest - margin, model.first), model.last),
        "Max Position Limit": max(min(highest + margin, model.last), model.first),
    }
