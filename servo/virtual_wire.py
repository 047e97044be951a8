"""The wire of a virtual bus: instruction packets in, status packets out (Dynamixel protocol 2.0)."""

from collections.abc import Iterable

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

from gesture_bot.servo.virtual_faults import WireFaults
from gesture_bot.servo.virtual_servo import VirtualServo

HEADER = bytes((0xFF, 0xFF, 0xFD, 0x00))
SDK = Protocol2PacketHandler()

LONGEST_PACKET = 512
"""A header that announces more bytes was damaged."""


def with_crc(packet: list[int]) -> bytes:
    """A packet with its CRC-16 appended."""
    return bytes((*packet, *SDK.updateCRC(0, packet, len(packet)).to_bytes(2, "little")))


def status_packet(servo_id: int, error: int, parameters: bytes) -> bytes:
    """A status packet, stuffed."""
    length = len(parameters) + 4
    packet = [*HEADER, servo_id, *length.to_bytes(2, "little"), INST_STATUS, error, *parameters, 0, 0]
    stuffed = SDK.addStuffing(packet)
    return with_crc(stuffed[:-2])


class VirtualWire:
    """Servos on one wire.

    Attributes:
        servos: The servos by ID.
        faults: What is wrong with the wire.
    """

    def __init__(self, servos: Iterable[VirtualServo]):
        self.servos = {servo.get("ID"): servo for servo in servos}
        self.faults = WireFaults()
        self._received = bytearray()

    def advance(self, seconds: float) -> None:
        """Let time pass for all servos."""
        for servo in self.servos.values():
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
            return self._status(servo_id, ERRNUM_CRC) if self._hears(servo_id) else b""
        for servo in self._listeners():
            servo.hear()
        plain = SDK.removeStuffing(list(packet))
        length = plain[PKT_LENGTH_L] | plain[PKT_LENGTH_L + 1] << 8
        parameters = bytes(plain[PKT_PARAMETER0 : PKT_INSTRUCTION + length - 2])
        if servo_id == BROADCAST_ID:
            return self._broadcast(instruction, parameters)
        return self._single(servo_id, instruction, parameters) if self._hears(servo_id) else b""

    def _hears(self, servo_id: int) -> bool:
        servo = self.servos.get(servo_id)
        return servo is not None and servo.power and servo_id not in self.faults.silent

    def _listeners(self) -> list[VirtualServo]:
        return [servo for servo_id, servo in self.servos.items() if self._hears(servo_id)]

    def _next_packet(self) -> bytes:
        """The next whole packet among the bytes received, or nothing yet."""
        start = self._received.find(HEADER)
        if start < 0:
            del self._received[: -len(HEADER) + 1]
            return b""
        del self._received[:start]
        stop = PKT_INSTRUCTION + int.from_bytes(self._received[PKT_LENGTH_L:PKT_INSTRUCTION], "little")
        if stop > LONGEST_PACKET:
            del self._received[: len(HEADER)]
            return self._next_packet()
        if len(self._received) < max(stop, PKT_PARAMETER0 + 2):
            return b""
        packet = bytes(self._received[:stop])
        del self._received[:stop]
        return packet

    def _single(self, servo_id: int, instruction: int, parameters: bytes) -> bytes:
        servo = self.servos[servo_id]
        level = servo.get("Status Return Level")
        address = int.from_bytes(parameters[:2], "little")
        if instruction == INST_PING:
            return self._status(servo_id, 0, servo.read(0, 2) + servo.read(6, 1))
        if instruction == INST_READ:
            size = int.from_bytes(parameters[2:4], "little")
            return self._status(servo_id, 0, servo.read(address, size)) if level > 0 else b""
        if instruction == INST_WRITE:
            error = servo.write(address, parameters[2:])
        elif instruction == INST_REBOOT:
            servo.reboot()
            error = 0
        else:
            error = ERRNUM_INSTRUCTION
        return self._status(servo_id, error) if level == 2 else b""

    def _broadcast(self, instruction: int, parameters: bytes) -> bytes:
        address = int.from_bytes(parameters[:2], "little")
        size = int.from_bytes(parameters[2:4], "little")
        if instruction == INST_PING:
            found = sorted(filter(self._hears, self.servos))
            return b"".join(self._single(servo_id, instruction, b"") for servo_id in found)
        if instruction == INST_WRITE:
            for servo in self._listeners():
                servo.write(address, parameters[2:])
        elif instruction == INST_SYNC_WRITE:
            for at in range(4, len(parameters), size + 1):
                if self._hears(parameters[at]):
                    self.servos[parameters[at]].write(address, parameters[at + 1 : at + 1 + size])
        elif instruction == INST_SYNC_READ:
            present = filter(self._hears, parameters[4:])
            return b"".join(
                self._status(servo_id, 0, self.servos[servo_id].read(address, size)) for servo_id in present
            )
        elif instruction == INST_FAST_SYNC_READ:
            return self._fast_status(list(parameters[4:]), address, size)
        return b""

    def _status(self, servo_id: int, error: int, parameters: bytes = b"") -> bytes:
        if self.faults.loses_reply():
            return b""
        return status_packet(servo_id, error | self._alert(servo_id), parameters)

    def _fast_status(self, ids: list[int], address: int, size: int) -> bytes:
        """One packet to which each servo adds its part and a CRC of all so far, until one is missing."""
        length = 1 + len(ids) * (size + 4)
        packet = bytes((*HEADER, BROADCAST_ID, *length.to_bytes(2, "little"), INST_STATUS))
        crc = SDK.updateCRC(0, packet, len(packet))
        for servo_id in ids:
            if not self._hears(servo_id) or self.faults.loses_reply():
                break
            part = bytes((self._alert(servo_id), servo_id)) + self.servos[servo_id].read(address, size)
            crc = SDK.updateCRC(crc, part, len(part))
            ending = crc.to_bytes(2, "little")
            packet += part + ending
            crc = SDK.updateCRC(crc, ending, 2)
        return packet

    def _alert(self, servo_id: int) -> int:
        return ERRBIT_ALERT if self.servos[servo_id].get("Hardware Error Status") else 0
