"""Finding the servos on a serial port."""

from collections.abc import Iterable, Iterator
from contextlib import closing
from dataclasses import dataclass

from serial.tools.list_ports import comports

from gesture_bot.base.errors import BusError
from gesture_bot.servo.bus import Bus
from gesture_bot.servo.models import model_name

LIKELY = (57_600, 1_000_000, 2_000_000, 3_000_000, 4_000_000, 115_200, 9_600)
"""Baud rates that are tried [bit/s]: the factory's, then the fast ones. The SDK does not know 4.5 Mbit/s."""

SHARED = "damaged answers: two servos have this ID, or a cable is bad. Unplug one, give the other a new ID"
"""What damaged answers mean, and what to do."""


@dataclass(frozen=True)
class Found:
    """A servo that answers.

    Attributes:
        port: Path of its serial port.
        baudrate: [bit/s].
        id: Dynamixel ID.
        model: Model name, or "" where the answers are damaged.
        firmware: Firmware version, 0 where the answers are damaged.
        clear: False where the answers are damaged, as when two servos have this ID.
    """

    port: str
    baudrate: int
    id: int
    model: str
    firmware: int
    clear: bool


def find_ports() -> list[str]:
    """The serial ports of this machine.

    Raises:
        BusError: There is none.
    """
    ports = sorted(found.device for found in comports())
    if not ports:
        raise BusError("this machine has no serial port: is the adapter plugged in?")
    return ports


def only_port() -> str:
    """The serial port, if there is just one.

    Raises:
        BusError: There is none, or there are several; lists them.
    """
    ports = find_ports()
    if len(ports) > 1:
        raise BusError("there are several serial ports: name one with --port", valid=ports)
    return ports[0]


def scan(port: str, baudrate: int) -> Iterator[Found]:
    """All servos on a port that speak at a baud rate [bit/s], in the order of their IDs.

    Raises:
        BusError: The port cannot be opened.
    """
    with closing(Bus(port, baudrate)) as bus:
        for servo_id, identity in bus.scan().items():
            if identity:
                clear = bus.is_clear(servo_id)
                yield Found(port, baudrate, servo_id, model_name(identity.model), identity.firmware, clear)
            else:
                yield Found(port, baudrate, servo_id, "", 0, False)


def find_baudrate(port: str, servo_id: int, baudrates: Iterable[int]) -> int:
    """The first of some baud rates at which a servo answers [bit/s].

    Raises:
        BusError: The port cannot be opened, or the servo answers at none.
    """
    tried = []
    for baudrate in baudrates:
        with closing(Bus(port, baudrate)) as bus:
            if servo_id in bus.scan():
                return baudrate
        tried.append(f"{baudrate} bit/s")
    raise BusError(f"servo {servo_id} does not answer on {port} at {', '.join(tried)}")
