"""What the long runs of the graph share: how they begin, how they go on, and what they say in the end."""

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TypeVar

import rclpy
from machine import machine
from rclpy.executors import Executor, SingleThreadedExecutor
from tqdm import tqdm

from gesture_bot.base.frames import FRAME_RATE
from gesture_bot.corpus.demo import demo_database
from gesture_bot.nodes.recorder import Record, Recorder
from gesture_bot.refine.smoothing import RADIUS

AnyRecorder = TypeVar("AnyRecorder", bound=Recorder)


@contextmanager
def listening(kind: type[AnyRecorder]) -> Iterator[tuple[AnyRecorder, Executor]]:
    """A recorder, and what spins it."""
    demo_database()
    rclpy.init()
    recorder = kind()
    executor = SingleThreadedExecutor()
    executor.add_node(recorder)
    try:
        yield recorder, executor
    finally:
        recorder.destroy_node()
        rclpy.shutdown()


def rounds(bench: str, minutes: float) -> Iterator[int]:
    """Numbers of rounds, until so much time has passed, with a progress bar."""
    begin, number = time.monotonic(), 0
    with tqdm(total=round(60 * minutes), desc=bench, unit="s") as progress:
        while time.monotonic() - begin < 60 * minutes:
            yield number
            number += 1
            progress.update(round(time.monotonic() - begin) - progress.n)


def late_trajectories(record: Record) -> int:
    """How many trajectories came when the joints should have been under way already."""
    known = RADIUS / FRAME_RATE
    return sum(heard.arrival > heard.stamp + known for heard in record.trajectories)


def report(bench: str, result: dict[str, object]) -> None:
    """Print the results, and in the last line all of them as one JSON object."""
    for name, value in result.items():
        print(f"{name}: {value}")
    print(json.dumps({"bench": bench, **result, "machine": machine()}))
