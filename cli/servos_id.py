"""`gesture-bot servos id`: another ID, and another baud rate, for one servo."""

import argparse
from contextlib import closing

from tqdm import tqdm

from gesture_bot.cli.servo_bus import release
from gesture_bot.servo.addressing import (
    change_baudrate,
    change_id,
    check_alone,
    check_free,
    check_new_address,
)
from gesture_bot.servo.bus import Bus
from gesture_bot.servo.scan import LIKELY, find_baudrate, only_port


def command(options: argparse.Namespace) -> int:
    """Change the ID of a servo, and its baud rate if asked; the exit status.

    Raises:
        GestureBotError: An option is not valid, the servo does not answer or shares its ID, or the new ID
            is taken.
    """
    port, old, new = options.port or only_port(), options.old, options.new
    check_new_address(new, options.set_baudrate or options.baudrate or 57_600)
    before = options.baudrate or find_baudrate(
        port, old, tqdm(LIKELY, "looking", unit="rate", leave=False, disable=None)
    )
    after = options.set_baudrate or before
    if after != before:
        with closing(Bus(port, after)) as bus:
            check_free(bus, new)
    with closing(Bus(port, before)) as bus:
        check_alone(bus, old)
        if new != old:
            check_free(bus, new)
        release(bus, [old])
        if new != old:
            change_id(bus, old, new)
        if after != before:
            change_baudrate(bus, new, after)
    print(f"servo {old} at {before} bit/s is servo {new} at {after} bit/s now")
    return 0
