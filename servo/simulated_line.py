"""A virtual bus in simulated time: it runs as fast as the computer can, and always alike."""

import errno
import math

from serial import SerialException

from gesture_bot.servo.bus import READ_WAIT, Port
from gesture_bot.servo.virtual_bus import BITS
from gesture_bot.servo.virtual_wire import VirtualWire

LONGEST_STEP = 0.005
"""Motion is computed in steps of at most this [s]."""


class SimulatedClock:
    """Takes the place of `time` for who uses the lines: time passes only in its own calls and in theirs.

    Attributes:
        wires: Whose servos move meanwhile.
    """

    def __init__(self) -> None:
        self.wires: list[VirtualWire] = []
        self._now = 0.0

    def monotonic(self) -> float:
        """The simulated time [s]."""
        return self._now

    def sleep(self, seconds: float) -> None:
        """Let time pass."""
        steps = max(1, math.ceil(seconds / LONGEST_STEP))
        for _ in range(steps):
            for wire in self.wires:
                wire.advance(float(seconds) / steps)
        self._now += float(seconds)


class SimulatedLine:
    """Takes the place of `serial.Serial`.

    Args:
        wire: The servos.
        baudrate: Symbols a second [bit/s]: each byte takes its time.
        clock: The time, if that of another line is to be this one's, too.

    Attributes:
        wire: The servos.
        clock: The time.
        connected: False: the port has vanished.
    """

    def __init__(self, wire: VirtualWire, baudrate: int, clock: SimulatedClock | None = None):
        self.wire = wire
        self.clock = clock or SimulatedClock()
        self.clock.wires.append(wire)
        self.connected = True
        self._byte = BITS / baudrate
        self._answer = b""

    def write(self, packet: list[int]) -> int:
        """Send a packet, and let the servos answer."""
        self._check()
        self.clock.sleep(self._byte * len(packet))
        answer = self.wire.receive(bytes(packet))
        self.clock.sleep(self._byte * len(answer))
        self._answer += answer
        return len(packet)

    def read(self, size: int) -> bytes:
        """Bytes that have come; waits a little where there are not enough."""
        self._check()
        if len(self._answer) < size:
            self.clock.sleep(READ_WAIT)
        data, self._answer = self._answer[:size], self._answer[size:]
        return data

    @property
    def in_waiting(self) -> int:
        """How many bytes have come, and are not read yet."""
        return len(self._answer)

    def reset_input_buffer(self) -> None:
        """Forget what has come."""
        self._check()
        self._answer = b""

    def close(self) -> None:
        """Nothing to close."""

    def _check(self) -> None:
        if not self.connected:
            raise SerialException(errno.EIO, "the port has vanished")


class SimulatedPort(Port):
    """The driver's port at the end of a simulated line."""

    def __init__(self, line: SimulatedLine):
        super().__init__("simulated")
        self.clock, self._line = line.clock, line

    def setupPort(self, cflag_baud: int) -> bool:  # noqa: D102, N802
        if not self._line.connected:
            raise SerialException(errno.ENOENT, "no such port")
        self.ser = self._line
        self.is_open = True
        self.tx_time_per_byte = 1000.0 * BITS / self.baudrate
        return True
