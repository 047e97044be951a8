"""`gesture-bot demo`: the graph in simulation, steered by a script, shown live and drawn afterwards."""

import argparse
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import NoReturn

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from rich.console import Console
from rich.live import Live
from rich.table import Table

from gesture_bot.base.errors import GestureBotError
from gesture_bot.base.files import write_whole
from gesture_bot.base.keypoints import INDEX
from gesture_bot.cli.demo_files import write_demo_files
from gesture_bot.cli.words import constraint_in_words
from gesture_bot.corpus.demo import demo_database
from gesture_bot.nodes.demo_director import DemoDirector
from gesture_bot.nodes.discovery import DISCOVERY, keep_local, refuse_company
from gesture_bot.nodes.graph import ARGUMENTS
from gesture_bot.nodes.messages import clip_from
from gesture_bot.nodes.recorder import Record
from gesture_bot.nodes.start import parse_arguments
from gesture_bot.retarget.robot import load_robot

TAKEN = ("robot", "studio", "studio_address")
"""The arguments of the graph that the demo takes."""

REFRESH = 0.1
"""Time between two pictures of the live table [s]."""

BUSY = 5.0
"""From so many missed deadlines on, of some 100, the motion suffers [1/s]."""


def command(options: argparse.Namespace) -> int:
    """`gesture-bot demo`: run the demo and write its files into a folder; the exit status.

    Args:
        options: arguments, NAME:=VALUE of those TAKEN; output, the folder.

    Raises:
        GestureBotError: The robot cannot be loaded, the folder cannot be written, another graph is running,
            or this one did not start, or ended early.
    """
    signal.signal(signal.SIGTERM, _end)
    console, output = Console(), options.output
    values = parse_arguments(options.arguments, [a for a in ARGUMENTS if a.name in TAKEN])
    display = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    studio = values.setdefault("studio", "true" if display else "false") == "true"
    robot = load_robot(str(values.get("robot", "toa")))
    log = output / "graph.log"
    demo_database()  # on first use this takes a while, and shows its progress
    keep_local()
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    director = DemoDirector(robot)
    executor = SingleThreadedExecutor()
    executor.add_node(director)
    try:
        time.sleep(DISCOVERY)
        refuse_company(director)
        with write_whole(log) as empty:  # makes the folder, too
            empty.touch()
        console.print("Starting the graph. Its topics are open: speak, steer or take over yourself, too.")
        if not studio:
            page = "http://127.0.0.1:8080/"
            console.print(f"studio:=true opens a page to see and steer it, by default at {page}")
        with (
            running_graph(log, *(f"{name}:={value}" for name, value in values.items())) as graph,
            Live(console=console, auto_refresh=False) as live,
        ):
            drawn = 0.0
            for _ in director.play():
                executor.spin_once(timeout_sec=0.02)
                if graph.poll() is not None:
                    raise GestureBotError("the graph ended early; its log says why", str(log))
                if studio and (address := studio_address(log)):
                    studio = False  # told once
                    console.print(f"See and steer it in your browser: {address}")
                if time.monotonic() - drawn > REFRESH:
                    drawn = time.monotonic()
                    live.update(_table(director.record, director.now()), refresh=True)
    finally:
        director.destroy_node()
        rclpy.try_shutdown()
    console.print("Drawing what happened.")
    summary = write_demo_files(output, director.record, robot)
    results = Table(title=f"{output}/summary.json", title_justify="left", show_header=False)
    for name, value in summary.items():
        results.add_row(name, _in_words(value))
    console.print(results)
    if summary["deadline_misses"] > BUSY * summary["duration_s"]:
        console.print("This machine was busy: much came late, and the robot can move better than this.")
    console.print(
        f"Look at {output}/gesture.gif and {output}/timeline.png, and listen to {output}/speech.wav."
    )
    return 0


def _end(number: int, _frame: FrameType | None) -> NoReturn:
    """As a shell tells it; the graph ends, too."""
    raise SystemExit(128 + number)


@contextmanager
def running_graph(log: Path, *arguments: str) -> Iterator[subprocess.Popen[bytes]]:
    """`gesture-bot run` in a process of its own, as for every user, which ends with the block.

    Args:
        log: Where its output goes.
        arguments: NAME:=VALUE.
    """
    command = [sys.executable, "-m", "gesture_bot.cli.main", "run", *arguments]
    with log.open("wb") as output:
        process = subprocess.Popen(command, stdout=output, stderr=output)
        try:
            yield process
        finally:
            process.send_signal(signal.SIGINT)
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()


def studio_address(log: Path) -> str:
    """Where the studio of a running graph is, by its log; empty until that tells it."""
    found = re.search(r"open (http\S+)", log.read_text(errors="replace"))
    return found[1] if found else ""


def _in_words(value: object) -> str:
    """A value of the summary on the screen: lists and tables a line each."""
    if isinstance(value, list):
        return "\n".join(map(_in_words, value))
    if isinstance(value, dict):
        return ", ".join(f"{name} {_in_words(part)}" for name, part in value.items())
    return str(value)


def _table(record: Record, now: float) -> Table:
    table = Table(show_header=False, width=72)
    word = next((h.message.text for h in reversed(record.words) if h.stamp <= now), "")
    window = next((h.message for h in reversed(record.selected) if h.stamp <= now), None)
    state = record.states[-1].message if record.states else None
    owners = record.owners[-1].message.owners if record.owners else []
    table.add_row("word", word)
    table.add_row("emotion", state.expression if state else "")
    table.add_row(
        "control", ", ".join(constraint_in_words(c) for c in state.constraints) or "free" if state else ""
    )
    if window:
        table.add_row("window", " ".join(filter(None, (window.source, window.name))))
        left, right = clip_from(window).keypoints[0, [INDEX["left_wrist"], INDEX["right_wrist"]], 2]
        table.add_row("wrist heights", f"left {left:.2f} m, right {right:.2f} m")
    table.add_row(
        "moved by", ", ".join(f"{name} ({owners.count(name)} joints)" for name in sorted(set(owners)))
    )
    table.add_row("measured", f"{len(record.joint_states)} joint states")
    return table
