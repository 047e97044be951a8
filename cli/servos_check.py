"""`gesture-bot servos check`: are the servos set up as the robot needs them."""

import argparse

from rich.console import Console
from rich.table import Table
from tqdm import tqdm

from gesture_bot.base.errors import BusError
from gesture_bot.cli.servo_bus import open_robot, release
from gesture_bot.servo.buses import RobotBus
from gesture_bot.servo.settings import Inspection, apply, inspect


def command(options: argparse.Namespace) -> int:
    """Compare the servos with the robot, and change them if asked.

    Returns:
        The exit status: 0 when all is as it should be, at the end.

    Raises:
        GestureBotError: There is no such robot or port, nobody answers, or a servo stops to.
    """
    console = Console(highlight=False, markup=False, soft_wrap=True)
    with open_robot(options) as (robot, bus):
        firsts = {bus.of(servo.id): servo.id for servo in reversed(robot.servos)}
        for own, first in firsts.items():
            if not own.is_clear(first) and not own.scan():
                rate = robot.bus.baudrate
                raise BusError(f"nobody answers at {rate} bit/s: is the power on? Another --port?", own.port)
        inspections = [
            inspect(bus.of(servo.id), robot, servo)
            for servo in tqdm(robot.servos, "checking", unit="servo", leave=False, disable=None)
        ]
        console.print(_table(inspections))
        for one in inspections:
            for problem in one.problems:
                console.print(f"servo {one.servo.id} of {one.servo.joint}: {problem}")
        if options.apply:
            _apply(bus, inspections)
    changes = sum(len(one.changes) for one in inspections)
    problems = sum(len(one.problems) for one in inspections)
    if changes:
        print(
            f"settings changed: {changes}" if options.apply else f"settings that --apply changes: {changes}"
        )
    if problems:
        print(f"problems that no setting solves: {problems}")
    if not changes and not problems:
        print("all servos are as the robot needs them")
    return int(problems > 0 or (changes > 0 and not options.apply))


def _apply(bus: RobotBus, inspections: list[Inspection]) -> None:
    to_change = [one for one in inspections if one.changes]
    release(bus, [one.servo.id for one in to_change])
    for one in tqdm(to_change, "changing", unit="servo", leave=False, disable=None):
        apply(bus.of(one.servo.id), one.servo, one.changes)


def _table(inspections: list[Inspection]) -> Table:
    table = Table(box=None, pad_edge=False)
    for column in ("joint", "id", "model, firmware"):
        table.add_column(column, no_wrap=True)
    table.add_column("setting -> as it should be")
    for one in inspections:
        model = f"{one.servo.model} v{one.firmware}" if one.firmware else one.servo.model
        settings = [
            f"{change.register} {change.value}{change.meaning and f' ({change.meaning})'} -> {change.wanted}"
            for change in one.changes
        ]
        if settings or not one.problems:
            table.add_row(one.servo.joint, str(one.servo.id), model, "\n".join(settings) or "in order")
    return table
