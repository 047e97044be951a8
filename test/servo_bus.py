"""Virtual buses for tests, with every packet on record: in simulated time, or in a thread of the test."""

import os
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

from dynamixel_sdk.robotis_def import INST_SYNC_WRITE, INST_WRITE

from gesture_bot.retarget.robot import Robot
from gesture_bot.servo.simulated_line import SimulatedLine, SimulatedPort
from gesture_bot.servo.virtual_bus import open_pseudo_terminal, serve, servo_specs
from gesture_bot.servo.virtual_servo import ServoSpec, VirtualServo
from gesture_bot.servo.virtual_wire import VirtualWire


class RecordingWire(VirtualWire):
    """A wire that remembers what was written: (id, address, bytes), sync writes servo by servo.

    `questions` counts the packets to all.
    """

    port: str | SimulatedPort
    questions = 0

    def __init__(self, servos):
        super().__init__(servos)
        self.writes: list[tuple[int, int, bytes]] = []

    def _single(self, servo_id, instruction, parameters):
        if instruction == INST_WRITE:
            self.writes.append((servo_id, int.from_bytes(parameters[:2], "little"), parameters[2:]))
        return super()._single(servo_id, instruction, parameters)

    def _broadcast(self, instruction, parameters):
        self.questions += 1
        if instruction == INST_SYNC_WRITE:
            address, size = (int.from_bytes(parameters[i : i + 2], "little") for i in (0, 2))
            for at in range(4, len(parameters), size + 1):
                self.writes.append((parameters[at], address, parameters[at + 1 : at + 1 + size]))
        return super()._broadcast(instruction, parameters)

    def written(self, servo_id: int, register: str) -> list[int]:
        """Values written to a register of a servo, in order."""
        item = self.servos[servo_id].model.table[register]
        return [
            int.from_bytes(data, "little")
            for written_id, address, data in self.writes
            if (written_id, address) == (servo_id, item.address)
        ]


def shown(servo: VirtualServo, register: str) -> int:
    """A register as a packet reads it, unsigned."""
    item = servo.model.table[register]
    return int.from_bytes(servo.read(item.address, item.size), "little")


def simulated_bus(robot: Robot) -> RecordingWire:
    """A bus in simulated time, which passes in the clock of the driver that uses its port."""
    wire = RecordingWire(map(VirtualServo, servo_specs(robot)))
    wire.port = SimulatedPort(SimulatedLine(wire, robot.bus.baudrate))
    return wire


@contextmanager
def recorded_bus(robot: Robot, more: Iterable[ServoSpec] = ()) -> Iterator[RecordingWire]:
    wire = RecordingWire(map(VirtualServo, [*servo_specs(robot), *more]))
    servos_end, wire.port = open_pseudo_terminal()
    stop_reading, stop = os.pipe()
    thread = threading.Thread(target=serve, args=({servos_end: wire}, stop_reading))
    thread.start()
    try:
        yield wire
    finally:
        os.close(stop)
        thread.join()
        os.close(stop_reading)
        os.close(servos_end)
