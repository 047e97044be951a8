"""`gesture-bot servos monitor`: a live table of what the servos say."""

import argparse
import contextlib
import math
import time

from rich.console import Console, JustifyMethod
from rich.live import Live
from rich.table import Table
from rich.text import Text

from gesture_bot.cli.servo_bus import open_robot
from gesture_bot.retarget.robot import Robot
from gesture_bot.servo.monitor import ServoState, read_states

COLUMNS = ("joint", "id", "state", "position", "heat", "current", "voltage")
"""What matters most comes first."""

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
            live.update(_table(robot, read_states(bus, robot), live.console))
            time.sleep(PERIOD)
    return 0


def _table(robot: Robot, states: list[ServoState | None], console: Console) -> Table:
    """The table, without the last columns where the terminal is too narrow for them."""
    rows = list(zip(robot.servos, states, strict=True))
    anyhow, wide = 3, console.options.update(max_width=1000)
    for count in range(len(COLUMNS), anyhow - 1, -1):
        table = Table(box=None, pad_edge=False)
        for column in COLUMNS[:count]:
            justify: JustifyMethod = "left" if column in ("joint", "state") else "right"
            table.add_column(column, justify=justify, no_wrap=True)
        for servo, state in rows:
            table.add_row(*(servo.joint, str(servo.id), *_cells(state))[:count])
        if table.__rich_measure__(console, wide).maximum <= console.width:
            break
    return table


def _cells(state: ServoState | None) -> tuple[str | Text, ...]:
    if state is None:
        return Text("does not answer", "red"), "", "", "", ""
    torque = "on" if state.torque else "off"
    effort = (
        f"{1000 * (state.current or 0):.0f} mA" if state.load is None else f"{100 * state.load:.0f} % load"
    )
    return (
        Text(f"{' and '.join(state.errors)}, {torque}", "red") if state.errors else f"torque {torque}",
        f"{math.degrees(state.position):z.1f}°",
        f"{state.temperature} °C",
        effort,
        f"{state.voltage:.1f} V",
    )
