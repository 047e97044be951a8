"""`gesture-bot doctor`: does this machine have what the robot needs, and what to do where it does not."""

import argparse

from rich.console import Console
from rich.table import Column, Table
from rich.text import Text

from gesture_bot.cli import STYLES
from gesture_bot.cli.doctor_checks import look


def command(options: argparse.Namespace) -> int:
    """Print a table of what was found, and what to do about it; the exit status: 1 where anything is bad."""
    console = Console(highlight=False, markup=False)
    table = Table("check", "", Column(overflow="fold"), box=None, pad_edge=False, show_header=False)
    states = []
    for finding in look():
        states.append(finding.state)
        found = "\n-> ".join(filter(None, (finding.found, finding.advice)))
        table.add_row(Text(finding.check), Text(finding.state, STYLES[finding.state]), Text(found))
    console.print(table)
    look_at, bad = states.count("look"), states.count("bad")
    console.print(f"{look_at} to look at, {bad} bad" if look_at or bad else "all is well")
    console.print("next: gesture-bot demo" if not bad else "In an issue, paste this table.")
    return int(bad > 0)
