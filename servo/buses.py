"""A robot whose servos are on several serial ports, such as one for each arm."""

from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.retarget.robot import Robot
from gesture_bot.servo.bus import Bus, Clock, Port
from gesture_bot.servo.table import series_of


class Buses:
    """Several buses as one, as far as all servos of a robot are asked and told something together.

    Each servo has an ID of its own, whichever bus it is on. `of` is for what one servo alone is asked.

    Args:
        buses: The bus of each servo, by ID.

    Attributes:
        port: Paths of the serial ports.
        clock: Tells the time.

    Raises:
        PortError: A port vanishes; from all methods.
    """

    def __init__(self, buses: Mapping[int, Bus]):
        self._of = dict(buses)
        self._buses = list(dict.fromkeys(buses.values()))
        self.port = ", ".join(bus.port for bus in self._buses)
        self.clock: Clock = self._buses[0].clock

    @property
    def latency_timer(self) -> int | None:
        """The longest of their USB adapters [ms]."""
        return max((timer for bus in self._buses if (timer := bus.latency_timer)), default=None)

    @property
    def asked_at(self) -> float:
        """When the last packet was sent [s]; a common question is sent on all buses at once."""
        return max(bus.asked_at for bus in self._buses)

    def of(self, servo_id: int) -> Bus:
        """The bus that a servo is on."""
        return self._of[servo_id]

    def hurry(self) -> None:
        """From now on, wait for an answer only as long as a cycle allows."""
        for bus in self._buses:
            bus.hurry()

    def close(self) -> None:
        """Close all ports, which may have vanished."""
        for bus in self._buses:
            bus.close()

    def sync_write(self, name: str, values: Mapping[int, int]) -> None:
        """As `Bus.sync_write`, with one packet a bus."""
        for bus, ids in self._shares(values):
            bus.sync_write(name, {servo_id: values[servo_id] for servo_id in ids})

    def set_all(self, ids: Iterable[int], name: str, value: int) -> None:
        """As `Bus.set_all`, one bus after the other."""
        for bus, share in self._shares(ids):
            bus.set_all(share, name, value)

    def sync_read(self, ids: Iterable[int], name: str, size: int, fast: bool) -> dict[int, bytes]:
        """As `Bus.sync_read`; all buses are asked before the first answer is read."""
        waiting: list[Callable[[], dict[int, bytes]]] = [
            bus.ask(share, name, size, fast) for bus, share in self._shares(ids)
        ]
        return {servo_id: data for answers in waiting for servo_id, data in answers().items()}

    def _shares(self, ids: Iterable[int]) -> list[tuple[Bus, list[int]]]:
        ids = list(ids)
        shares = [(bus, [servo_id for servo_id in ids if self._of[servo_id] is bus]) for bus in self._buses]
        return [(bus, share) for bus, share in shares if share]


RobotBus = Bus | Buses
"""What all servos of a robot are on."""


def read_ports(text: str, robot: Robot) -> dict[str, str]:
    """The serial port of each bus of a robot: `/dev/ttyUSB0`, or `left=/dev/ttyUSB0 right=/dev/ttyUSB1`.

    Raises:
        InvalidValueError: A bus has no port, or a name is none of a bus; lists the valid names.
    """
    names = robot.buses
    if names == ("",) or (len(names) == 1 and "=" not in text):
        return {names[0]: text}
    ports: dict[str, str] = {}
    for word in text.split():
        name, _, path = word.partition("=")
        if not path:
            raise InvalidValueError(f"{robot.name} has several buses: write NAME=PORT, not", word, names)
        if name not in names:
            raise InvalidValueError(f"{robot.name} has no bus", name, names)
        if name in ports or path in ports.values():
            raise InvalidValueError("each bus has a port of its own, but twice there is", word)
        ports[name] = path
    for name in names:
        if name not in ports:
            raise InvalidValueError(f"{robot.name} needs NAME=PORT for each bus, also for", name, names)
    return ports


def open_bus(robot: Robot, ports: Mapping[str, str | Port]) -> RobotBus:
    """Open the bus of a robot, or all of them.

    Args:
        robot: Whose servos they are.
        ports: Path of each serial port, or a port of another kind, by the name of the bus.

    Raises:
        BusError: A port cannot be opened. None is open then.
        RobotError: The servo table names an unknown model, or servos of several series on one bus.
    """
    series = series_of(robot)
    with ExitStack() as opened:
        buses = {}
        for name in robot.buses:
            buses[name] = Bus(ports[name], robot.bus.baudrate, series[name])
            opened.callback(buses[name].close)
        opened.pop_all()
    if len(buses) == 1:
        return buses[robot.buses[0]]
    return Buses({servo.id: buses[servo.bus] for servo in robot.servos})
