"""A virtual Dynamixel bus behind a pseudo-terminal, which the driver opens like any serial port.

    python -m gesture_bot.servo.virtual_bus ROBOT

prints the port of a bus with ROBOT's servos in its rest pose, and serves it until Ctrl-C.
"""

import argparse
import contextlib
import json
import os
import pty
import select
import subprocess
import sys
import termios
import time
import tty
from dataclasses import asdict
from types import TracebackType
from typing import TYPE_CHECKING

from gesture_bot.base.errors import BusError, GestureBotError, RobotError
from gesture_bot.servo.fault_words import read_faults, set_faults
from gesture_bot.servo.models import BAUD_RATES, find_model
from gesture_bot.servo.virtual_servo import ServoSpec, VirtualServo
from gesture_bot.servo.virtual_wire import VirtualWire

if TYPE_CHECKING:
    from gesture_bot.retarget.robot import Robot

CHILD = "-"
"""In place of a robot: the servos come as JSON on the standard input."""

BITS = 10
"""A byte on the wire has a start and a stop bit."""

SPEEDS = {getattr(termios, f"B{rate}"): rate for rate in BAUD_RATES.values() if hasattr(termios, f"B{rate}")}
"""Baud rates [bit/s] by what the system calls them."""

LONGEST_STEP = 0.01
"""Motion is computed in steps of at most this [s]."""


def servo_specs(robot: "Robot") -> list[ServoSpec]:
    """The servos of a `retarget.robot.Robot`, standing in its rest pose.

    Raises:
        RobotError: A servo is of an unknown model, or the bus has a baud rate that no servo knows.
    """
    if robot.bus.baudrate not in BAUD_RATES.values():
        raise RobotError("no servo speaks at this baud rate", robot.bus.baudrate, BAUD_RATES.values())
    return [
        ServoSpec(
            row.id,
            row.model,
            find_model(row.model).ticks(row.direction * angle + row.offset),
            robot.bus.baudrate,
        )
        for row, angle in zip(robot.servos, robot.rest, strict=True)
    ]


def open_pseudo_terminal() -> tuple[int, str]:
    """The servos' end of a new pseudo-terminal (a file descriptor) and the path of the controller's end."""
    servos_end, controllers_end = pty.openpty()
    tty.setraw(controllers_end)
    # Our own copy of the controller's end stays open, so that the line outlives a controller that closes it.
    return servos_end, os.ttyname(controllers_end)


def serve(wire: VirtualWire, servos_end: int, commands: int) -> None:
    """Answer packets in real time until the file descriptor `commands` ends; its lines set faults.

    Each byte, either way, takes its time on the wire, and the wire carries one at a time.
    """
    last = free = time.monotonic()
    while True:
        readable, _, _ = select.select([servos_end, commands], [], [], 10 * LONGEST_STEP)
        now = time.monotonic()
        while last < now:
            step = min(now - last, LONGEST_STEP)
            wire.advance(step)
            last += step
        if commands in readable:
            lines = os.read(commands, 4096).decode()
            if not lines:
                return
            set_faults(wire, lines.splitlines()[-1])
        if servos_end in readable:
            _, _, _, _, speed, _, _ = termios.tcgetattr(servos_end)
            wire.baudrate = SPEEDS.get(speed)
            packets = os.read(servos_end, 4096)
            answers = wire.receive(packets)
            byte_time = BITS / wire.baudrate if wire.baudrate else 0.0
            free = max(free, now) + byte_time * (len(packets) + len(answers))
            if answers:  # what nobody answers only makes the next bytes wait
                time.sleep(max(free - time.monotonic(), 0.0))
                os.write(servos_end, answers)


class VirtualBus:
    """A virtual bus in a process of its own, so that it takes no time from the driver.

    It ends with the block, and also when the process that started it dies.

    Args:
        robot: A `retarget.robot.Robot`; its servos stand in the rest pose.

    Attributes:
        port: Path of the serial port.
    """

    port: str

    def __init__(self, robot: "Robot"):
        self._ids = [row.id for row in robot.servos]
        self._specs = servo_specs(robot)

    def __enter__(self) -> "VirtualBus":
        # The child ends when its standard input does: the kernel closes that for us, however we die. A Ctrl-C
        # in our terminal must not reach it, since the driver still has to bring the arms to rest.
        self._process = subprocess.Popen(
            [sys.executable, "-m", __spec__.name, CHILD],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        assert self._process.stdin and self._process.stdout
        print(json.dumps([asdict(spec) for spec in self._specs]), file=self._process.stdin, flush=True)
        self.port = self._process.stdout.readline().strip()
        if not self.port:
            raise BusError("the virtual bus did not start")
        return self

    def inject(self, faults: str) -> None:
        """Let exactly these faults be in force, in words as `fault_words.read_faults` takes; "" is none.

        Raises:
            InvalidValueError: A word is no fault, or its value does not fit.
        """
        read_faults(faults, self._ids)
        assert self._process.stdin
        print(*faults.split(), file=self._process.stdin, flush=True)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        assert self._process.stdin and self._process.stdout
        self._process.stdin.close()
        self._process.stdout.close()
        self._process.wait()


def _child() -> None:
    specs = [ServoSpec(**row) for row in json.loads(sys.stdin.readline())]
    servos_end, port = open_pseudo_terminal()
    print(port, flush=True)
    serve(VirtualWire(map(VirtualServo, specs)), servos_end, sys.stdin.fileno())


def main() -> None:
    """Serve the bus of the robot named on the command line, or be the child of a VirtualBus."""
    parser = argparse.ArgumentParser("virtual_bus", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("robot", metavar="ROBOT", help="name, or path of its YAML file")
    robot = parser.parse_args().robot
    if robot == CHILD:
        _child()
        return
    from gesture_bot.retarget.robot import load_robot  # which the child does without, to start fast

    try:
        with VirtualBus(load_robot(robot)) as bus, contextlib.suppress(KeyboardInterrupt):
            print(bus.port, flush=True)
            while True:
                time.sleep(3600)
    except GestureBotError as error:
        sys.exit(f"virtual_bus: {error}")


if __name__ == "__main__":
    main()
