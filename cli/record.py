"""`gesture-bot record`: the graph's topics into a file, until Ctrl-C."""

import argparse
import signal
import time

import rclpy
from rclpy.signals import SignalHandlerOptions
from tqdm import tqdm

from gesture_bot.nodes.bag_recorder import BagRecorder
from gesture_bot.nodes.discovery import keep_local

PERIOD = 0.05
"""From one look for new messages to the next [s]."""

SETTLING = 1.0
"""New topics are looked for, and what has come is brought to the disk, so often [s]."""


def command(options: argparse.Namespace) -> int:
    """`gesture-bot record`: record until Ctrl-C; the exit status.

    Args:
        options: output, the file; topics, some or none for all; overwrite.

    Raises:
        GestureBotError: The file cannot be written, or is there already.
    """
    keep_local()
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    stopped = False

    def stop(*_: object) -> None:
        nonlocal stopped
        stopped = True

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, stop)
    try:
        recorder = BagRecorder(options.output, options.topics, options.overwrite)
        begin, passed, looked = time.monotonic(), 0.0, -SETTLING
        with tqdm(bar_format="{desc}", disable=None) as line:
            while not stopped:
                recorder.drain()
                passed = time.monotonic() - begin
                if passed >= looked + SETTLING:
                    looked = passed
                    recorder.look_around()
                    line.set_description_str(f"{passed:.0f} s, {recorder.messages} messages; Ctrl-C ends it")
                time.sleep(PERIOD)
        recorder.destroy_node()
    finally:
        rclpy.try_shutdown()
    silent = f"; nothing came on {', '.join(sorted(recorder.missing))}" if recorder.missing else ""
    print(f"wrote {options.output}: {passed:.0f} s, {recorder.messages} messages{silent}")
    if not recorder.messages and not options.topics:
        print("nobody was heard: does `gesture-bot run` run, with the same ROS_DOMAIN_ID?")
    return 0
