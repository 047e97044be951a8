"""Faults of a running virtual bus, in words: `bit_noise=0.01 silent=14,15`."""

from collections.abc import Collection, Iterable
from dataclasses import dataclass, field

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.servo.virtual_wire import VirtualWire

SHARES = ("bit_noise", "lost_replies")
SERVOS = ("silent", "stuck", "unplugged", "hot")
"""Servos by ID that neither hear nor answer, whose joint does not turn, that have no power, that are hot."""

HOT = 70.0
COOL = 40.0
"""Temperature of a servo that becomes hot, and of one that is no longer [degC]."""


@dataclass
class Faults:
    """Shares and servos by the name of the fault."""

    shares: dict[str, float] = field(default_factory=lambda: dict.fromkeys(SHARES, 0.0))
    servos: dict[str, set[int]] = field(default_factory=lambda: {name: set() for name in SERVOS})


def read_faults(text: str, ids: Collection[int]) -> Faults:
    """What a text of words `name=value` means; what it does not name is well. No word: all is well.

    Args:
        text: The words. Shares are from 0 to 0.5, servos are IDs with commas between.
        ids: The servos there are.

    Raises:
        InvalidValueError: A word is none of these; lists the valid names, or IDs.
    """
    faults = Faults()
    for word in text.split():
        name, _, value = word.partition("=")
        if name not in SHARES + SERVOS:
            raise InvalidValueError("no such fault of the virtual bus", name, SHARES + SERVOS)
        try:
            if name in SHARES:
                faults.shares[name] = float(value)
            else:
                faults.servos[name] = {int(one) for one in value.split(",")}
        except ValueError as error:
            raise InvalidValueError(f"the fault {name} wants a number", value) from error
    for name, share in faults.shares.items():
        if not 0.0 <= share <= 0.5:
            raise InvalidValueError(f"the share {name} must be from 0 to 0.5", share)
    for servo_id in set().union(*faults.servos.values()) - set(ids):
        raise InvalidValueError("no servo of the virtual bus has this ID", servo_id, ids)
    return faults


def set_faults(wires: Iterable[VirtualWire], text: str) -> None:
    """Let exactly these faults be in force on some wires.

    Raises:
        InvalidValueError: As `read_faults`.
    """
    wires = list(wires)
    servos = {servo_id: servo for wire in wires for servo_id, servo in wire.servos.items()}
    faults = read_faults(text, servos)
    for wire in wires:
        wire.faults.bit_noise = faults.shares["bit_noise"]
        wire.faults.lost_replies = faults.shares["lost_replies"]
        wire.faults.silent = faults.servos["silent"]
    for servo_id, servo in servos.items():
        servo.stuck = servo_id in faults.servos["stuck"]
        if servo_id in faults.servos["unplugged"]:
            servo.power = False
        elif not servo.power:
            servo.reboot()
        if servo_id in faults.servos["hot"]:
            servo.temperature = HOT
        elif servo.temperature > COOL:
            servo.temperature = COOL
