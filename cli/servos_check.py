"""`gesture-bot servos check`: are the servos set up as the robot needs them."""

import argparse

from rich.console import Console
from rich.table import Table
from tqdm import tqdm

from gesture_bot.cli.servo_bus import open_robot, release
from gesture_bot.servo.bus import Bus
from gesture_bot.servo.settings import Inspection, apply, inspect


def command(options: argparse.Namespace) -> int:
    """Compare the servos with the robot, and change them if asked.

    Returns:
        The exit status: 0 when all is as it should be, at the end.

    Raises:
        GestureBotError: There is no such robot or port, or a servo stops answering.
    """
    console = Console(highlight=False, markup=False, soft_wrap=True)
    with open_robot(options) as (robot, bus):
        inspections = [
            inspect(bus, robot, servo) for servo in tqdm(robot.servos, "checking", unit="servo", leave=False)
        ]
        console.print(_table(inspections))
        if options.apply:
            _apply(bus, inspections)
    changes = sum(len(one.changes) for one in inspections)
    problems = sum(len(one.problems) for one in inspections)
    if changes and not options.apply:
        print(f"{changes} settings would change: gesture-bot servos check {options.robot} --apply")
    elif changes:
        print(f"{changes} settings changed")
    if problems:
        print(f"{problems} problems are left to you")
    elif not changes:
        print("all servos are as the robot needs them")
    return int(problems > 0 or (changes > 0 and not options.apply))


def _apply(bus: Bus, inspections: list[Inspection]) -> None:
    to_change = [one for one in inspections if one.changes]
    release(bus, [one.servo.id for one in to_change])
    for one in tqdm(to_change, "changing", unit="servo", leave=False):
        apply(bus, one.servo, one.changes)


def _table(inspections: list[Inspection]) -> Table:
    table = Table("joint", "id", "model", "firmware", "is", "should be", box=None, pad_edge=False)
    for one in inspections:
        rows = [(problem, "") for problem in one.problems]
        rows += [(f"{change.register} {change.value}", str(change.wanted)) for change in one.changes]
        name, *first = one.servo.joint, str(one.servo.id), one.servo.model, str(one.firmware or "")
        for row in rows or [("in order", "")]:
            table.add_row(name, *first, *row)
            name, first = "", ["", "", ""]
    return table
