"""`gesture-bot teleop`: move a robot's joints by keys, while the graph runs."""

import argparse
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rich.console import Console
from rich.live import Live

from gesture_bot.base.errors import GestureBotError
from gesture_bot.cli.keyboard import keyboard
from gesture_bot.cli.teleop_panel import Panel
from gesture_bot.nodes.discovery import keep_local
from gesture_bot.nodes.terminal_teleop import TerminalTeleop
from gesture_bot.retarget.robot import Robot, load_robot

REFRESH = 0.1
"""Time between two pictures [s]."""

PATIENCE = 3.0
"""A graph that runs is heard within this time [s]."""


def command(options: argparse.Namespace) -> int:
    """Move joints until `q`; the exit status.

    Raises:
        GestureBotError: This is no terminal, there is no such robot, or no graph moves it.
    """
    console = Console()
    if not (sys.stdin.isatty() and console.is_terminal):
        raise GestureBotError("gesture-bot teleop needs a terminal, to show joints on and to read keys from")
    robot = load_robot(options.robot)
    keep_local()
    with _operator(robot) as (operator, spin):
        _wait_for_joints(robot, operator, spin)
        panel = Panel(robot, operator)
        with keyboard() as pressed, Live(console=console, screen=True, auto_refresh=False) as live:
            drawn = 0.0
            while panel.running:
                keys = pressed()
                for key in keys:
                    panel.press(key)
                if keys or time.monotonic() - drawn > REFRESH:
                    drawn = time.monotonic()
                    live.update(panel.picture(console.height), refresh=True)
                spin(0.02)
    console.print("All joints are given back.")
    return 0


@contextmanager
def _operator(robot: Robot) -> Iterator[tuple[TerminalTeleop, Callable[[float], None]]]:
    """The operator's node, and what lets it work for some time [s]."""
    context = rclpy.Context()  # one of our own leaves the signals alone
    rclpy.init(context=context)
    operator = TerminalTeleop(robot, context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(operator)
    try:
        yield operator, executor.spin_once
    finally:
        executor.shutdown()
        operator.destroy_node()
        rclpy.try_shutdown(context=context)


def _wait_for_joints(robot: Robot, operator: TerminalTeleop, spin: Callable[[float], None]) -> None:
    give_up = time.monotonic() + PATIENCE
    while np.isnan(operator.measured).all():
        if time.monotonic() > give_up:
            raise GestureBotError(
                f"no joint of {robot.name} is heard on joint_states within {PATIENCE:g} s: `gesture-bot run` "
                "must be running, with this robot and the same ROS_DOMAIN_ID"
            )
        spin(0.05)
