"""`gesture-bot servos monitor`: a live table of what the servos say."""

import argparse
import contextlib
import math
import time

from rich.live import Live
from rich.table import Table
from rich.text import Text

from gesture_bot.cli.servo_bus import open_robot
from gesture_bot.retarget.robot import Robot
from gesture_bot.servo.monitor import ServoState, read_states

PERIOD = 0.1
"""Time between two looks [s]."""


def command(options: argparse.Namespace) -> int:
    """Show the table until Ctrl-C; the exit status.

    Raises:
        GestureBotError: There is no such robot or port, or the port vanishes.
    """
    with open_robot(options) as (robot, bus), contextlib.suppress(KeyboardInterrupt), Live() as live:
        bus.hurry()
        while True:
            live.update(_table(robot, read_states(bus, robot)))
            time.sleep(PERIOD)
    return 0


def _table(robot: Robot, states: list[ServoState | None]) -> Table:
    table = Table(box=None, pad_edge=False)
    table.add_column("joint", no_wrap=True)
    for column in ("id", "position", "current", "heat", "voltage"):
        table.add_column(column, justify="right", no_wrap=True)
    table.add_column("torque")
    table.add_column("errors")
    for servo, state in zip(robot.servos, states, strict=True):
        table.add_row(servo.joint, str(servo.id), *_cells(state))
    return table


def _cells(state: ServoState | None) -> tuple[str | Text, ...]:
    if state is None:
        return "", "", "", "", "", Text("does not answer", "red")
    effort = (
        f"{1000 * (state.current or 0):.0f} mA" if state.load is None else f"{100 * state.load:.0f} % load"
    )
    return (
        f"{math.degrees(state.position):z.1f}°",
        effort,
        f"{state.temperature} °C",
        f"{state.voltage:.1f} V",
        "on" if state.torque else "off",
        Text(" and ".join(state.errors), "red"),
    )
