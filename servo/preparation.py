"""Before the robot may move: every servo is there, is the right one, and stands ready where it is."""

import math
from collections.abc import Iterator

import numpy as np

from gesture_bot.base.errors import BusError
from gesture_bot.retarget.robot import Robot, ServoEntry
from gesture_bot.servo.bus import Bus
from gesture_bot.servo.buses import RobotBus
from gesture_bot.servo.models import (
    HARDWARE_ERRORS,
    POSITION_MODE,
    find_model,
    model_name,
)
from gesture_bot.servo.scan import SHARED
from gesture_bot.servo.table import PRESENT, ServoTable

SETTINGS = {"Operating Mode": POSITION_MODE, "Drive Mode": 0, "Return Delay Time": 0}
"""EEPROM registers: position control, forward, profiles in velocities, answers at once."""


def check_servos(buses: RobotBus, robot: Robot) -> None:
    """See that each servo of the table answers, is of the right model, and is well.

    Raises:
        BusError: One does not or is not; names its joint and ID.
    """
    for servo in robot.servos:
        bus = buses.of(servo.id)
        number = bus.ping(servo.id)
        if number is None:
            found = bus.scan()
            if servo.id in found:
                raise BusError(f"servo {servo.id} of {servo.joint}: {SHARED}")
            message = f"no servo answers for {servo.joint} on {bus.port}, at ID"
            raise BusError(message, servo.id, found if found else ["no servo at all"])
        if number != find_model(servo.model).number:
            raise BusError(
                f"servo {servo.id} of {servo.joint} is of another model", model_name(number), [servo.model]
            )
        errors = hardware_errors(bus.read(servo.id, "Hardware Error Status"))
        if errors:
            raise BusError(
                f"servo {servo.id} of {servo.joint} reports {' and '.join(errors)}; "
                "find out why, then switch it off and on"
            )


def hardware_errors(status: int) -> tuple[str, ...]:
    """What Hardware Error Status (70) means."""
    return tuple(name for bit, name in HARDWARE_ERRORS.items() if status & 1 << bit)


def set_up(bus: Bus, robot: Robot, servo: ServoEntry) -> None:
    """Set a servo up, and switch torque on with the goal where the joint is, so that it does not move.

    Raises:
        BusError: The servo does not answer, or cannot reach the joint's whole range.
    """
    for _ in setting_up(bus, robot, servo):
        pass


def setting_up(bus: Bus, robot: Robot, servo: ServoEntry) -> Iterator[None]:
    """The same in steps of a few packets, between which the other servos get their goals.

    Profile Velocity is the joint's velocity limit: a second belt, for the safety envelope shapes all motion.

    Raises:
        BusError: As `set_up`.
    """
    joint = robot.joints.index(servo.joint)
    # EEPROM wears out, and is locked while torque is on: only what differs is written.
    changes = {}
    for name, value in SETTINGS.items():
        if bus.read(servo.id, name) != value:
            changes[name] = value
        yield
    if changes:
        bus.write(servo.id, "Torque Enable", 0)
    for name, value in changes.items():
        bus.write(servo.id, name, value)
        yield
    table = ServoTable(robot)
    ends = sorted((table.ticks(robot.limits.lower)[joint], table.ticks(robot.limits.upper)[joint]))
    # The two lie side by side.
    limits = bus.read_bytes(servo.id, bus.registers["Max Position Limit"].address, 8)
    highest, lowest = np.frombuffer(limits, "<i4")
    if not lowest <= ends[0] <= ends[1] <= highest:
        raise BusError(
            f"servo {servo.id} turns from {lowest} to {highest}; {servo.joint} needs {ends[0]} to {ends[1]}"
        )
    yield
    bus.write(servo.id, "Bus Watchdog", 0)
    yield
    bus.write(servo.id, "Profile Acceleration", 0)
    yield
    unit = find_model(servo.model).series.velocity_unit
    bus.write(servo.id, "Profile Velocity", math.ceil(robot.limits.velocity[joint] / unit))
    yield
    # A limp joint may be moving: its goal is as fresh as can be. Nothing else is read in so many bytes, so
    # that no late answer to another question is taken for where the joint is.
    address = bus.registers["Present Load"].address
    present = np.frombuffer(bus.read_bytes(servo.id, address, PRESENT.itemsize), PRESENT)
    bus.write(servo.id, "Goal Position", int(present["position"][0]))
    bus.write(servo.id, "Torque Enable", 1)
