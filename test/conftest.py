"""A ROS graph of its own for the tests, and a listener on it."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest

# The nodes' executables look for python3 on the path: it is the one of this environment.
os.environ["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
os.environ["ROS_DOMAIN_ID"] = str(1 + os.getpid() % 100)
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"


def wait_until(condition: Callable[[], object], limit: float, what: str) -> None:
    """Wait until something holds; fail with its name when it does not within `limit` seconds."""
    give_up = time.monotonic() + limit
    while not condition():
        assert time.monotonic() < give_up, f"waited {limit} s for {what}"
        time.sleep(0.02)


def command(*arguments: str) -> list[str]:
    """The `gesture-bot` command of this environment."""
    return [sys.executable, "-m", "gesture_bot.cli.main", *arguments]


@contextmanager
def running(arguments: Sequence[str]) -> Iterator[subprocess.Popen[str]]:
    """A process that is interrupted, as by Ctrl-C, when the block ends."""
    process = subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        yield process
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()
                raise
        process.stdout.close()


@pytest.fixture(scope="session")
def demo_corpus():
    """Build the demo corpus once, before anything waits for it."""
    from gesture_bot.corpus.demo import demo_database

    return demo_database()


@contextmanager
def listening():
    """A Recorder that spins in a thread."""
    import rclpy
    from rclpy.executors import SingleThreadedExecutor

    from gesture_bot.nodes.recorder import Recorder

    context = rclpy.Context()
    rclpy.init(context=context)
    node = Recorder(context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    spinning = threading.Thread(target=executor.spin, daemon=True)
    spinning.start()
    yield node
    executor.shutdown()
    rclpy.shutdown(context=context)
    spinning.join(5)
    node.destroy_node()


@pytest.fixture
def listener():
    """A Recorder that spins in a thread."""
    with listening() as node:
        yield node
