"""The wire of a virtual bus: instruction packets in, status packets out (Dynamixel protocol 2.0)."""

import functools
import itertools
import operator
from collections.abc import Iterable, Sequence

from dynamixel_sdk.protocol2_packet_handler import (
    ERRBIT_ALERT,
    ERRNUM_CRC,
    ERRNUM_INSTRUCTION,
    PKT_ID,
    PKT_INSTRUCTION,
    PKT_LENGTH_L,
    PKT_PARAMETER0,
    Protocol2PacketHandler,
)
from dynamixel_sdk.robotis_def import (
    BROADCAST_ID,
    INST_FAST_SYNC_READ,
    INST_PING,
    INST_READ,
    INST_REBOOT,
    INST_STATUS,
    INST_SYNC_READ,
    INST_SYNC_WRITE,
    INST_WRITE,
)

from gesture_bot.servo.models import X
from gesture_bot.servo.virtual_faults import WireFaults
from gesture_bot.servo.virtual_servo import VirtualServo

HEADER = bytes((0xFF, 0xFF, 0xFD, 0x00))
SDK = Protocol2PacketHandler()

SHORTEST_PACKET, LONGEST_PACKET = PKT_PARAMETER0 + 2, 512
"""A header that announces fewer or more bytes was damaged."""


def with_crc(packet: list[int]) -> bytes:
    """A packet with its CRC-16 appended."""
    return bytes((*packet, *SDK.updateCRC(0, packet, len(packet)).to_bytes(2, "little")))


def status_packet(servo_id: int, error: int, parameters: bytes) -> bytes:
    """A status packet, stuffed."""
    length = len(parameters) + 4
    packet = [*HEADER, servo_id, *length.to_bytes(2, "little"), INST_STATUS, error, *parameters, 0, 0]
    stuffed = SDK.addStuffing(packet)
    return with_crc(stuffed[:-2])


def _alert(servo: VirtualServo) -> int:
    return ERRBIT_ALERT if servo.get("Hardware Error Status") else 0


def collided(answers: Sequence[bytes]) -> bytes:
    """What is heard of servos that speak at once: a bit is 1 where none of them pulls the line down."""
    if len(answers) == 1:
        return answers[0]
    return bytes(
        functools.reduce(operator.and_, column) for column in itertools.zip_longest(*answers, fillvalue=0xFF)
    )


class VirtualWire:
    """Servos on one wire.

    Two servos may have the same ID: both obey, and both answer at once.

    Attributes:
        servos: The servos by ID; of two with one ID, the first.
        baudrate: How fast the controller speaks [bit/s]: only servos that are set to it understand. None
            where that is not known: then all do.
        faults: What is wrong with the wire.
    """

    def __init__(self, servos: Iterable[VirtualServo]):
        self.baudrate: int | None = None
        self.faults = WireFaults()
        self._received = bytearray()
        self._sort(servos)

    def advance(self, seconds: float) -> None:
        """Let time pass for all servos."""
        for servo in (*self.servos.values(), *self._twins):
            servo.advance(seconds)

    def receive(self, data: bytes) -> bytes:
        """Take bytes from the controller; returns the bytes that the servos answer."""
        self._received += self.faults.through(data)
        answers = b""
        while packet := self._next_packet():
            answers += self.execute(packet)
        return self.faults.through(answers)

    def execute(self, packet: bytes) -> bytes:
        """Carry out a whole instruction packet; returns the status packets."""
        servo_id, instruction = packet[PKT_ID], packet[PKT_INSTRUCTION]
        if SDK.updateCRC(0, packet, len(packet) - 2) != int.from_bytes(packet[-2:], "little"):
            return collided(
                [self._status(servo, servo_id, ERRNUM_CRC) for servo in self._listeners(servo_id)]
            )
        for servo in self._listeners():
            servo.hear()
        plain = SDK.removeStuffing(list(packet))
        length = plain[PKT_LENGTH_L] | plain[PKT_LENGTH_L + 1] << 8
        parameters = bytes(plain[PKT_PARAMETER0 : PKT_INSTRUCTION + length - 2])
        if servo_id == BROADCAST_ID:
            return self._broadcast(instruction, parameters)
        return self._single(servo_id, instruction, parameters)

    def _next_packet(self) -> bytes:
        """The next whole packet among the bytes received, or nothing yet."""
        start = self._received.find(HEADER)
        if start < 0:
            del self._received[: -len(HEADER) + 1]
            return b""
        del self._received[:start]
        if len(self._received) < SHORTEST_PACKET:
            return b""
        stop = PKT_INSTRUCTION + int.from_bytes(self._received[PKT_LENGTH_L:PKT_INSTRUCTION], "little")
        if not SHORTEST_PACKET <= stop <= LONGEST_PACKET:
            del self._received[: len(HEADER)]
            return self._next_packet()
        if len(self._received) < stop:
            return b""
        packet = bytes(self._received[:stop])
        del self._received[:stop]
        return packet

    def _sort(self, servos: Iterable[VirtualServo]) -> None:
        """Find the servos by their IDs, which packets may change."""
        self.servos: dict[int, VirtualServo] = {}
        self._twins: list[VirtualServo] = []
        for servo in servos:
            if self.servos.setdefault(servo.get("ID"), servo) is not servo:
                self._twins.append(servo)

    def _listeners(self, servo_id: int | None = None) -> list[VirtualServo]:
        """The servos with an ID, or all, that understand the controller."""
        if servo_id is None:
            found = [*self.servos.values(), *self._twins]
        else:
            found = [self.servos[servo_id]] if servo_id in self.servos else []
            found += [twin for twin in self._twins if twin.get("ID") == servo_id]
        return [servo for servo in found if self._hears(servo)]

    def _hears(self, servo: VirtualServo) -> bool:
        return (
            servo.power
            and servo.get("ID") not in self.faults.silent
            and self.baudrate in (None, servo.baudrate)
        )

    def _single(self, servo_id: int, instruction: int, parameters: bytes) -> bytes:
        address = int.from_bytes(parameters[:2], "little")
        answers = []
        for servo in self._listeners(servo_id):
            level, error, data = servo.get("Status Return Level"), 0, b""
            needed = 2
            if instruction == INST_PING:
                needed, data = 0, servo.read(0, 2) + servo.read(6, 1)
            elif instruction == INST_READ:
                needed, data = 1, servo.read(address, int.from_bytes(parameters[2:4], "little"))
            elif instruction == INST_WRITE:
                error = servo.write(address, parameters[2:])
            elif instruction == INST_REBOOT:
                servo.reboot()
            else:
                error = ERRNUM_INSTRUCTION
            if level >= needed:
                answers.append(self._status(servo, servo_id, error, data))
        if instruction == INST_WRITE and address < X.ram:
            self._sort([*self.servos.values(), *self._twins])
        return collided(answers)

    def _broadcast(self, instruction: int, parameters: bytes) -> bytes:
        address = int.from_bytes(parameters[:2], "little")
        size = int.from_bytes(parameters[2:4], "little")
        if instruction == INST_PING:
            return b"".join(self._single(servo_id, instruction, b"") for servo_id in sorted(self.servos))
        if instruction == INST_WRITE:
            for servo_id in list(self.servos):
                self._single(servo_id, instruction, parameters)
        elif instruction == INST_SYNC_WRITE:
            for at in range(4, len(parameters), size + 1):
                for servo in self._listeners(parameters[at]):
                    servo.write(address, parameters[at + 1 : at + 1 + size])
            if address < X.ram:
                self._sort([*self.servos.values(), *self._twins])
        elif instruction == INST_SYNC_READ:
            return b"".join(
                collided(
                    [self._status(servo, i, 0, servo.read(address, size)) for servo in self._listeners(i)]
                )
                for i in parameters[4:]
            )
        elif instruction == INST_FAST_SYNC_READ:
            return self._fast_status(list(parameters[4:]), address, size)
        return b""

    def _status(self, servo: VirtualServo, servo_id: int, error: int, parameters: bytes = b"") -> bytes:
        """What a servo answers under the ID by which it was asked."""
        if self.faults.loses_reply():
            return b""
        return status_packet(servo_id, error | _alert(servo), parameters)

    def _fast_status(self, ids: list[int], address: int, size: int) -> bytes:
        """One packet to which each servo adds its part and a CRC of all so far, until one is missing."""
        length = 1 + len(ids) * (size + 4)
        packet = bytes((*HEADER, BROADCAST_ID, *length.to_bytes(2, "little"), INST_STATUS))
        crc = SDK.updateCRC(0, packet, len(packet))
        for servo_id in ids:
            asked = self._listeners(servo_id)
            if not asked or self.faults.loses_reply():
                break
            part = collided([bytes((_alert(servo), servo_id)) + servo.read(address, size) for servo in asked])
            crc = SDK.updateCRC(crc, part, len(part))
            ending = crc.to_bytes(2, "little")
            packet += part + ending
            crc = SDK.updateCRC(crc, ending, 2)
        return packet
