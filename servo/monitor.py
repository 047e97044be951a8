"""What all servos of a robot say of themselves, in one look."""

from dataclasses import dataclass

import numpy as np

from gesture_bot.retarget.robot import Robot
from gesture_bot.servo.buses import RobotBus
from gesture_bot.servo.models import X, find_model
from gesture_bot.servo.preparation import hardware_errors
from gesture_bot.servo.table import joint_angle

FIELDS = {
    "Torque Enable": "u1", "Hardware Error Status": "u1", "Present Load": "<i2", "Present Position": "<i4",
    "Present Input Voltage": "<u2", "Present Temperature": "u1",
}  # fmt: skip

RECORD = np.dtype(
    {
        "names": list(FIELDS),
        "formats": list(FIELDS.values()),
        "offsets": [X.registers[name].address - X.registers["Torque Enable"].address for name in FIELDS],
    }
)
"""All of it lies within 83 bytes, from Torque Enable (64) on; so it does in the P series, from 512 on."""


@dataclass(frozen=True)
class ServoState:
    """The state of a servo.

    Attributes:
        torque: Whether the motor is on.
        position: Angle of the joint [rad].
        current: Current of the motor [A]; None where the model does not measure it.
        load: Share of the largest torque, from -1 to 1; None where the model measures the current.
        temperature: [degC].
        voltage: [V].
        errors: The hardware errors it reports.
    """

    torque: bool
    position: float
    current: float | None
    load: float | None
    temperature: int
    voltage: float
    errors: tuple[str, ...]


def read_states(bus: RobotBus, robot: Robot) -> list[ServoState | None]:
    """The states of a robot's servos, in the order of its joints; None for one that does not answer.

    Raises:
        BusError: The port has vanished.
    """
    ids = [servo.id for servo in robot.servos]
    answers = bus.sync_read(ids, "Torque Enable", RECORD.itemsize, fast=False)
    for servo_id in set(ids) - set(answers):
        own = bus.of(servo_id)
        first = own.registers["Torque Enable"].address
        answers[servo_id] = own.try_read(servo_id, first, RECORD.itemsize)
    return [_state(robot, joint, answers[servo_id]) for joint, servo_id in enumerate(ids)]


def _state(robot: Robot, joint: int, data: bytes) -> ServoState | None:
    if not data:
        return None
    record, servo = np.frombuffer(data, RECORD)[0], robot.servos[joint]
    unit = find_model(servo.model).current_unit
    return ServoState(
        torque=bool(record["Torque Enable"]),
        position=joint_angle(servo, int(record["Present Position"])),
        current=record["Present Load"] * unit if unit else None,
        load=None if unit else record["Present Load"] / 1000,
        temperature=int(record["Present Temperature"]),
        voltage=record["Present Input Voltage"] / 10,
        errors=hardware_errors(int(record["Hardware Error Status"])),
    )
