"""What the `gesture-bot servos` commands share: the open bus, and asking people."""

import argparse
import os
import select
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing, contextmanager

from gesture_bot.base.errors import GestureBotError
from gesture_bot.retarget.robot import Robot, load_robot
from gesture_bot.servo.buses import RobotBus, open_bus, read_ports
from gesture_bot.servo.scan import only_port
from gesture_bot.servo.settings import with_torque


@contextmanager
def open_robot(options: argparse.Namespace) -> Iterator[tuple[Robot, RobotBus]]:
    """The robot that is named on the command line, and its open bus, or all of them.

    Raises:
        GestureBotError: There is no such robot or port, or the port cannot be opened.
    """
    robot = load_robot(options.robot)
    port = options.port or (only_port() if len(robot.buses) == 1 else "")
    with closing(open_bus(robot, read_ports(port, robot))) as bus:
        yield robot, bus


def release(bus: RobotBus, ids: Iterable[int]) -> None:
    """Switch torque off, after somebody has said that the robot is held.

    Raises:
        GestureBotError: Nobody has, or a servo does not answer.
    """
    powered = with_torque(bus, ids)
    if powered:
        names = ", ".join(map(str, powered))
        ask(f"Hold the robot: torque goes off at servo {names}. Enter: go on, Ctrl-C: leave it on.")
    for servo_id in powered:
        bus.of(servo_id).write(servo_id, "Torque Enable", 0)


def ask(question: str) -> None:
    """Wait for Enter."""
    print(question, flush=True)
    answer()


def answer(meanwhile: Callable[[], None] = lambda: None, period: float = 0.1) -> str:
    """The next line that somebody types.

    Args:
        meanwhile: Called again and again until the line is there.
        period: How often [s].

    Raises:
        GestureBotError: The input has ended.
    """
    # Python's own buffer would hide from `select` what it has read already.
    line, keyboard = b"", sys.stdin.fileno()
    while not line.endswith(b"\n"):
        if select.select([keyboard], [], [], period)[0]:
            key = os.read(keyboard, 1)
            if not key:
                raise GestureBotError("nobody answers: the input has ended")
            line += key
        else:
            meanwhile()
    return line.decode(errors="replace").strip().lower()
