"""`gesture-bot servos scan`: which servos there are."""

import argparse
import sys

from rich.console import Console
from rich.table import Table
from tqdm import tqdm

from gesture_bot.base.errors import BusError
from gesture_bot.servo.scan import LIKELY, SHARED, Found, find_ports, scan


def command(options: argparse.Namespace) -> int:
    """Look for servos on all ports, or on those named, at all baud rates, or at those named; the exit status.

    Raises:
        BusError: There is no port, none can be opened, or no servo answers.
    """
    ports, rates = options.ports or find_ports(), options.baudrate or LIKELY
    found: list[Found] = []
    refusals: dict[str, BusError] = {}
    with tqdm(
        total=len(ports) * len(rates), desc="looking", unit="rate", leave=False, disable=None
    ) as progress:
        for port in ports:
            for baudrate in rates:
                progress.set_postfix_str(f"{port} {baudrate} bit/s, {len(found)} found")
                if port not in refusals:
                    try:
                        found += scan(port, baudrate)
                    except BusError as error:
                        refusals[port] = error
                progress.update()
    if len(refusals) == len(ports) == 1:
        raise refusals[ports[0]]
    for refusal in refusals.values():
        print(f"left out: {refusal}", file=sys.stderr)
    if not found:
        looked = ", ".join(port for port in ports if port not in refusals) or "any port"
        raise BusError(
            f"no servo answers on {looked} at {', '.join(map(str, rates))} bit/s: is the power on? "
            "Only protocol 2.0 is understood"
        )
    console = Console(highlight=False, markup=False, soft_wrap=True)
    console.print(_table(found))
    for one in found:
        if not one.clear:
            console.print(f"servo {one.id} on {one.port}: {SHARED}")
    return 0


def _table(found: list[Found]) -> Table:
    table = Table("port", "baud rate", "id", "model", "firmware", box=None, pad_edge=False)
    for one in found:
        table.add_row(one.port, str(one.baudrate), str(one.id), one.model, str(one.firmware or ""))
    return table
