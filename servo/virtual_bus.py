"""A virtual Dynamixel bus behind a pseudo-terminal, which the driver opens like any serial port.

    python -m gesture_bot.servo.virtual_bus ROBOT

prints the port of a bus with ROBOT's servos in its rest pose, and serves it until Ctrl-C.
"""

import argparse
import contextlib
import heapq
import itertools
import json
import os
import pty
import select
import subprocess
import sys
import termios
import time
import tty
from collections.abc import Mapping
from dataclasses import asdict
from types import TracebackType
from typing import TYPE_CHECKING

from gesture_bot.base.errors import BusError, GestureBotError, InvalidValueError, RobotError
from gesture_bot.servo.fault_words import read_faults, set_faults
from gesture_bot.servo.models import BAUD_RATES, find_model
from gesture_bot.servo.virtual_servo import ServoSpec, VirtualServo
from gesture_bot.servo.virtual_wire import VirtualWire

if TYPE_CHECKING:
    from gesture_bot.retarget.robot import Robot

PHYSICS = ("first_order", "mujoco")
"""What there may be behind the servos."""

CHILD = "-"
"""In place of a robot: the servos come as JSON on the standard input."""

BITS = 10
"""A byte on the wire has a start and a stop bit."""

SPEEDS = {getattr(termios, f"B{rate}"): rate for rate in BAUD_RATES.values() if hasattr(termios, f"B{rate}")}
"""Baud rates [bit/s] by what the system calls them."""

LONGEST_STEP = 0.01
"""Motion is computed in steps of at most this [s]."""

PAUSE = 0.1
"""After a longer gap the process had to wait for its turn [s]."""


def servo_specs(robot: "Robot", bus: str | None = None) -> list[ServoSpec]:
    """The servos of a `retarget.robot.Robot`, or those on one of its buses, standing in its rest pose.

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
            row.joint,
            row.direction,
            row.offset,
        )
        for row, angle in zip(robot.servos, robot.rest, strict=True)
        if bus in (None, row.bus)
    ]


def open_pseudo_terminal() -> tuple[int, str]:
    """The servos' end of a new pseudo-terminal (a file descriptor) and the path of the controller's end."""
    servos_end, controllers_end = pty.openpty()
    tty.setraw(controllers_end)
    # Our own copy of the controller's end stays open, so that the line outlives a controller that closes it.
    return servos_end, os.ttyname(controllers_end)


def serve(wires: Mapping[int, VirtualWire], commands: int) -> None:
    """Answer packets in real time until the file descriptor `commands` ends; its lines set faults.

    Each byte, either way, takes its time on the wire, and a wire carries one at a time.

    Args:
        wires: Each by the servos' end of its pseudo-terminal (a file descriptor).
        commands: Where words for `set_faults` come from.
    """
    last = time.monotonic()
    free = dict.fromkeys(wires, last)
    on_the_way: list[tuple[float, int, bytes]] = []
    while True:
        due = on_the_way[0][0] if on_the_way else last + PAUSE / 2
        readable, _, _ = select.select([*wires, commands], [], [], max(due - time.monotonic(), 0.0))
        now = time.monotonic()
        while on_the_way and on_the_way[0][0] <= now:
            _, servos_end, answers = heapq.heappop(on_the_way)
            os.write(servos_end, answers)
        if now - last > PAUSE:  # its servos did not live through it: their watchdogs must not bite
            last = now
        while last < now and (readable or now - last > LONGEST_STEP):
            step = min(now - last, LONGEST_STEP)
            for wire in wires.values():
                wire.advance(step)
            last += step
        if commands in readable:
            lines = os.read(commands, 4096).decode()
            if not lines:
                return
            set_faults(wires.values(), lines.splitlines()[-1])
        for servos_end in wires.keys() & readable:
            wire = wires[servos_end]
            _, _, _, _, speed, _, _ = termios.tcgetattr(servos_end)
            wire.baudrate = SPEEDS.get(speed)
            packets = os.read(servos_end, 4096)
            answers = wire.receive(packets)
            byte_time = BITS / wire.baudrate if wire.baudrate else 0.0
            free[servos_end] = max(free[servos_end], now) + byte_time * (len(packets) + len(answers))
            if answers:  # what nobody answers only makes the next bytes wait
                heapq.heappush(on_the_way, (free[servos_end], servos_end, answers))


class VirtualBus:
    """A virtual bus in a process of its own, so that it takes no time from the driver.

    It ends with the block, and also when the process that started it dies.

    Args:
        robot: A `retarget.robot.Robot`; its servos stand in the rest pose.
        physics: One of PHYSICS: `first_order` joints follow their servos as if they had no weight;
            with `mujoco` the robot's URDF has gravity, inertia, and motors with the torque of the servos.

    Attributes:
        port: Path of the serial port; of several buses as `buses.read_ports` takes it.
        process: In which it runs.
    """

    port: str
    process: subprocess.Popen[str]

    def __init__(self, robot: "Robot", physics: str = PHYSICS[0]):
        if physics not in PHYSICS:
            raise InvalidValueError("the virtual bus knows no such physics", physics, PHYSICS)
        self._ids = [row.id for row in robot.servos]
        wires = {name: [asdict(spec) for spec in servo_specs(robot, name)] for name in robot.buses}
        body = {"name": robot.name, "urdf": robot.urdf} if physics == "mujoco" else None
        self._task = json.dumps({"wires": wires, "body": body})

    def __enter__(self) -> "VirtualBus":
        # The child ends when its standard input does: the kernel closes that for us, however we die. A Ctrl-C
        # in our terminal must not reach it, since the driver still has to bring the arms to rest.
        self.process = subprocess.Popen(
            [sys.executable, "-m", __spec__.name, CHILD],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        assert self.process.stdin and self.process.stdout
        print(self._task, file=self.process.stdin, flush=True)
        self.port = self.process.stdout.readline().strip()
        if not self.port:
            raise BusError("the virtual bus did not start")
        return self

    def inject(self, faults: str) -> None:
        """Let exactly these faults be in force, in words as `fault_words.read_faults` takes; "" is none.

        Raises:
            InvalidValueError: A word is no fault, or its value does not fit.
        """
        read_faults(faults, self._ids)
        assert self.process.stdin
        print(*faults.split(), file=self.process.stdin, flush=True)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        assert self.process.stdin and self.process.stdout
        self.process.stdin.close()
        self.process.stdout.close()
        self.process.wait()


def _child() -> None:
    task = json.loads(sys.stdin.readline())
    specs = {name: [ServoSpec(**row) for row in rows] for name, rows in task["wires"].items()}
    body = None
    if task["body"]:
        from gesture_bot.servo.virtual_body import Body  # MuJoCo takes its time

        body = Body(servos=itertools.chain(*specs.values()), **task["body"])
    wires, ports = {}, []
    for name, own in specs.items():
        servos_end, port = open_pseudo_terminal()
        wires[servos_end] = VirtualWire(
            VirtualServo(spec, body.joint(spec) if body else None) for spec in own
        )
        ports.append(f"{name}={port}" if name else port)
    print(*ports, flush=True)
    serve(wires, sys.stdin.fileno())


def main() -> None:
    """Serve the bus of the robot named on the command line, or be the child of a VirtualBus."""
    parser = argparse.ArgumentParser("virtual_bus", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("robot", metavar="ROBOT", help="name, or path of its YAML file")
    parser.add_argument("--physics", choices=PHYSICS, default=PHYSICS[0], help="what moves the joints")
    options = parser.parse_args()
    robot = options.robot
    if robot == CHILD:
        _child()
        return
    from gesture_bot.retarget.robot import load_robot  # which the child does without, to start fast

    try:
        with VirtualBus(load_robot(robot), options.physics) as bus, contextlib.suppress(KeyboardInterrupt):
            print(bus.port, flush=True)
            while True:
                time.sleep(3600)
    except GestureBotError as error:
        sys.exit(f"virtual_bus: {error}")


if __name__ == "__main__":
    main()
