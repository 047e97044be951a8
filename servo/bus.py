"""Access to Dynamixel servos on a serial port, through the DynamixelSDK (protocol 2.0)."""

import errno
import functools
import re
import termios
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import NamedTuple, Protocol

from dynamixel_sdk import (
    COMM_RX_CORRUPT,
    COMM_SUCCESS,
    GroupSyncRead,
    GroupSyncWrite,
    PortHandler,
    Protocol2PacketHandler,
)
from dynamixel_sdk.protocol2_packet_handler import PKT_ERROR, PKT_ID, PKT_LENGTH_H, PKT_LENGTH_L
from serial.tools.list_ports import comports

from gesture_bot.base.errors import BusError, PortError
from gesture_bot.servo.latency_timer import shorten
from gesture_bot.servo.models import Series, X, series_with

READ_WAIT = 0.002
"""How long a read of the port sleeps for bytes to come [s]."""

PATIENT_WAIT = 100.0
"""Time for an answer at the start, beyond that of its bytes on the wire [ms]: a busy machine can be slow."""

REPLY_WAIT = 10.0
"""The same in a cycle [ms]; the SDK's 34 ms would cost three cycles."""

ATTEMPTS = 3
"""How often a ping, read or write is tried before it fails."""

IDENTITY_SIZE = 7
"""Model Number (0) to Firmware Version (6). Nothing else is read in so many bytes."""

CONFIRMATION_SIZE = 11
"""Bytes of an answer without data."""

PING_ANSWER = re.compile(rb"\xff\xff\xfd\x00[\x00-\xfc]\x07\x00\x55", re.DOTALL)
"""How the answer to a ping begins, with the ID of who answers."""

REFUSALS = {
    errno.EACCES: "no permission to open the serial port (join the group dialout, then log in anew)",
    errno.EAGAIN: "another program uses the serial port",
    errno.EBUSY: "another program uses the serial port",
}
"""What the system means when it does not open a port that exists."""


def _bytes(value: int, size: int) -> list[int]:
    """A register's value, signed or not, as bytes."""
    return list((value % (1 << 8 * size)).to_bytes(size, "little"))


class Identity(NamedTuple):
    """Model Number (0) and Firmware Version (6) of a servo."""

    model: int
    firmware: int


class Clock(Protocol):
    """What the module `time` is to the bus and the driver; a simulated bus has its own."""

    def monotonic(self) -> float:
        """Time that never goes back [s]."""

    def sleep(self, seconds: float, /) -> None:
        """Wait."""


class Port(PortHandler):
    """The SDK's port, but a read sleeps until bytes come: with the SDK's own, it asks in a busy loop.

    Attributes:
        reply_wait: Time for an answer, beyond that of its bytes on the wire [ms].
        written_at: When the last packet was sent, on the clock [s].
        heard: What has come since then.
        clock: Tells the time.
        latency_timer: Of a USB adapter that has one [ms], else None.
    """

    latency_timer: int | None = None
    reply_wait = PATIENT_WAIT
    written_at = 0.0
    heard = b""
    clock: Clock = time

    def setupPort(self, cflag_baud: int) -> bool:  # noqa: D102, N802
        super().setupPort(cflag_baud)
        self.ser.timeout = READ_WAIT
        self.ser.exclusive = True
        self.latency_timer = shorten(self.ser)
        return True

    def writePort(self, packet: list[int]) -> int:  # noqa: D102, N802
        self.written_at = self.clock.monotonic()
        self.heard = b""
        return int(super().writePort(packet))

    def readPort(self, length: int) -> bytes:  # noqa: D102, N802
        data = bytes(super().readPort(length))
        self.heard += data
        return data

    def setPacketTimeout(self, packet_length: int) -> None:  # noqa: D102, N802
        self.setPacketTimeoutMillis(self.tx_time_per_byte * packet_length + self.reply_wait)

    def isPacketTimeout(self) -> bool:  # noqa: D102, N802
        # What came while this thread paused is in time.
        return bool(super().isPacketTimeout()) and not self.ser.in_waiting

    def getCurrentTime(self) -> float:  # noqa: D102, N802
        return 1000.0 * self.clock.monotonic()  # the SDK's own is the wall clock, which may be set


class _PacketHandler(Protocol2PacketHandler):
    """The SDK's packets, but a late answer to an earlier question is not taken for that to this one."""

    def rxPacket(self, port: Port, fast_option: bool) -> tuple[list[int], int]:  # noqa: N802
        try:
            return super().rxPacket(port, fast_option)  # type: ignore[no-any-return]
        except IndexError:  # the SDK trips over a packet whose length was damaged
            return [], COMM_RX_CORRUPT

    def readMany(self, port: Port, ids: list[int], length: int) -> dict[int, bytes]:  # noqa: N802
        """Answers by ID, as many as come whole: a damaged one does not cost the others."""
        found: dict[int, bytes] = {}
        for _ in range(2 * len(ids)):  # late answers to an earlier question, and rubbish, count too
            packet, result = self.rxPacket(port, False)
            if result == COMM_SUCCESS and packet[PKT_ID] in ids and _answered(packet) == length:
                found[packet[PKT_ID]] = bytes(packet[PKT_ERROR + 1 :][:length])
            if len(found) == len(ids) or (result != COMM_SUCCESS and port.isPacketTimeout()):
                break
        return found

    def readRx(self, port: Port, dxl_id: int, length: int) -> tuple[list[int], int, int]:  # noqa: N802
        while True:
            packet, result = self.rxPacket(port, False)
            if result != COMM_SUCCESS:
                return [], result, 0
            if packet[PKT_ID] == dxl_id and _answered(packet) == length:
                return packet[PKT_ERROR + 1 :][:length], result, packet[PKT_ERROR]

    def writeTxRx(  # noqa: N802
        self, port: Port, dxl_id: int, address: int, length: int, data: list[int]
    ) -> tuple[int, int]:
        result = self.writeTxOnly(port, dxl_id, address, length, data)
        if result != COMM_SUCCESS:
            return result, 0
        port.setPacketTimeout(CONFIRMATION_SIZE)
        _, result, error = self.readRx(port, dxl_id, 0)
        return result, error


def _answered(packet: list[int]) -> int:
    """Bytes of data in an answer, which holds its error and a CRC beside them."""
    return int.from_bytes(packet[PKT_LENGTH_L : PKT_LENGTH_H + 1], "little") - 4


class Bus:
    """An open serial port with servos on it.

    Args:
        port: Path of the serial port, or a port of another kind.
        baudrate: Symbols a second [bit/s].
        series: Of the servos: says where the registers are that have names.

    Attributes:
        port: Path of the serial port.
        registers: Address and size by name.
        clock: Tells the time.

    Raises:
        BusError: The port cannot be opened; lists the serial ports there are.
        PortError: The port vanishes; from all methods.
    """

    def __init__(self, port: str | Port, baudrate: int, series: Series = X):
        self._port = Port(port) if isinstance(port, str) else port
        self.registers = series.registers
        self.port: str = self._port.port_name
        self.clock = self._port.clock
        self._port.reply_wait = PATIENT_WAIT
        self._sdk = _PacketHandler()
        try:
            opened = self._port.setBaudRate(baudrate)
        except (OSError, termios.error) as error:
            number = error.args[0] if error.args else None
            if number in REFUSALS:
                raise BusError(REFUSALS[number], self.port) from error
            ports = [found.device for found in comports()] or ["no serial port found"]
            raise BusError("cannot open the serial port", self.port, ports) from error
        if not opened:
            raise BusError("the SDK does not know this baud rate", baudrate)

    @property
    def latency_timer(self) -> int | None:
        """Of a USB adapter that has one [ms]: answers wait as long in it."""
        return self._port.latency_timer

    @property
    def asked_at(self) -> float:
        """When the last packet was sent, on the monotonic clock [s]: a servo that is asked measures then."""
        return self._port.written_at

    def of(self, servo_id: int) -> "Bus":  # noqa: ARG002
        """The bus that a servo is on: this one. `Buses` has several."""
        return self

    def hurry(self) -> None:
        """From now on, wait for an answer only as long as a cycle allows."""
        self._port.reply_wait = REPLY_WAIT

    def close(self) -> None:
        """Close the port, which may have vanished."""
        with suppress(OSError, termios.error):
            self._port.closePort()

    def ping(self, servo_id: int) -> int | None:
        """Model Number (0) of a servo, or None when none with this ID answers."""
        # Not by a ping: the SDK would take a late answer to something else for the one to it.
        for _ in range(ATTEMPTS):
            if data := self.try_read(servo_id, self.registers["Model Number"].address, IDENTITY_SIZE):
                return int.from_bytes(data[:2], "little")
        return None

    def scan(self) -> dict[int, Identity | None]:
        """All servos that answer, by ID; None where the answer is damaged. Takes about a second."""
        with self._port_errors():
            found, _ = self._sdk.broadcastPing(self._port)
        identities = {servo_id: Identity(*answer) for servo_id, answer in found.items()}
        speakers = {answer[PKT_ID] for answer in PING_ANSWER.findall(self._port.heard)}
        return {servo_id: identities.get(servo_id) for servo_id in sorted(speakers)}

    def is_clear(self, servo_id: int) -> bool:
        """Whether what a servo says of its state comes undamaged, at least once in a few times.

        Where two servos have one ID, both speak at once, and what they say differs: their clocks (120) do.
        """
        registers = series_with(self.ping(servo_id)).registers
        address = registers["Realtime Tick"].address
        size = registers["Present Temperature"].address + 1 - address
        return any(self.try_read(servo_id, address, size) for _ in range(ATTEMPTS))

    def read(self, servo_id: int, name: str) -> int:
        """The value of a register by its name, unsigned.

        Raises:
            BusError: The servo does not answer.
        """
        item = self.registers[name]
        return int.from_bytes(self.read_bytes(servo_id, item.address, item.size), "little")

    def read_bytes(self, servo_id: int, address: int, size: int) -> bytes:
        """Some bytes of the control table.

        Raises:
            BusError: The servo does not answer.
        """
        for _ in range(ATTEMPTS):
            if data := self.try_read(servo_id, address, size):
                return data
            # An answer that comes late must not be taken for that to the next question.
            self.clock.sleep(self._port.reply_wait / 1000)
        raise BusError(f"servo {servo_id} on {self.port} stopped answering when asked for register {address}")

    def try_read(self, servo_id: int, address: int, size: int) -> bytes:
        """Ask once for bytes of the control table; nothing when the servo does not answer."""
        with self._port_errors():
            if self._sdk.readTx(self._port, servo_id, address, size) != COMM_SUCCESS:
                return b""
            data, _, _ = self._sdk.readRx(self._port, servo_id, size)
        return bytes(data)

    def write(self, servo_id: int, name: str, value: int) -> None:
        """Set a register by its name.

        Raises:
            BusError: The servo does not answer, or refuses the value.
        """
        item = self.registers[name]
        data = _bytes(value, item.size)
        with self._port_errors():
            for _ in range(ATTEMPTS):
                result, error = self._sdk.writeTxRx(self._port, servo_id, item.address, item.size, data)
                if result == COMM_SUCCESS:
                    break
        if result != COMM_SUCCESS:
            raise BusError(f"servo {servo_id} on {self.port} stopped answering when {name} was written")
        if error & 0x7F:
            raise BusError(
                f"servo {servo_id} refuses {name}: {self._sdk.getRxPacketError(error & 0x7F)}", value
            )

    def sync_write(self, name: str, values: Mapping[int, int]) -> None:
        """Set a register of several servos, by ID, with one packet that nobody answers."""
        item = self.registers[name]
        group = GroupSyncWrite(self._port, self._sdk, item.address, item.size)
        for servo_id, value in values.items():
            group.addParam(servo_id, _bytes(value, item.size))
        with self._port_errors():
            group.txPacket()

    def set_all(self, ids: Iterable[int], name: str, value: int) -> None:
        """Set a register of several servos to one value, again until all confirm it or the attempts end."""
        item, ids = self.registers[name], list(ids)
        if not ids:
            return
        for _ in range(ATTEMPTS):
            self.sync_write(name, dict.fromkeys(ids, value))
            answers = self.sync_read(ids, name, item.size, fast=False)
            if answers == dict.fromkeys(ids, bytes(_bytes(value, item.size))):
                return

    def sync_read(self, ids: Iterable[int], name: str, size: int, fast: bool) -> dict[int, bytes]:
        """The same bytes of the control table from several servos, in one transaction.

        Args:
            ids: Who is asked.
            name: The register where they begin.
            size: How many bytes.
            fast: All answer in one packet (Fast Sync Read), which older firmware does not know.

        Returns:
            Bytes by ID of those that have answered; with `fast` it is all or none.
        """
        return self.ask(ids, name, size, fast)()

    def ask(self, ids: Iterable[int], name: str, size: int, fast: bool) -> Callable[[], dict[int, bytes]]:
        """Send the question of a `sync_read`, and return what waits for its answers."""
        ids = list(ids)
        if not ids:
            return dict
        group = GroupSyncRead(self._port, self._sdk, self.registers[name].address, size)
        for servo_id in ids:
            group.addParam(servo_id)
        with self._port_errors():
            sent = group.fastSyncReadTxPacket() if fast else group.txPacket()
        return functools.partial(self._answers, group, fast) if sent == COMM_SUCCESS else dict

    def _answers(self, group: GroupSyncRead, fast: bool) -> dict[int, bytes]:
        try:
            with self._port_errors():
                if not fast:
                    return self._sdk.readMany(self._port, list(group.data_dict), group.data_length)
                result = group.fastSyncReadRxPacket()
        except IndexError:
            return {}  # The SDK trips over a late answer to an earlier question.
        if result != COMM_SUCCESS:
            return {}
        return {servo_id: bytes(data) for servo_id, data in group.data_dict.items()}

    @contextmanager
    def _port_errors(self) -> Iterator[None]:
        try:
            yield
        except (OSError, termios.error) as error:
            raise PortError("the serial port has vanished", self.port) from error
        finally:
            self._port.is_using = False
