"""From `stop` to the first braking goal on the bus, while the whole graph speaks in one process.

`make bench-stop`; the last line is one JSON object. `--trials` is how often; topic and service take turns.
"""

import argparse
import json
import os
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import rclpy
from dynamixel_sdk.robotis_def import INST_SYNC_WRITE
from machine import machine
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import Bool, String
from std_srvs.srv import Trigger
from tqdm import tqdm

from gesture_bot.cli.demo import running_graph
from gesture_bot.corpus.demo import demo_database
from gesture_bot.nodes.node import PLAN
from gesture_bot.retarget.robot import load_robot
from gesture_bot.servo.models import find_model, signed
from gesture_bot.servo.virtual_bus import open_pseudo_terminal, serve, servo_specs
from gesture_bot.servo.virtual_servo import VirtualServo
from gesture_bot.servo.virtual_wire import VirtualWire

ROBOT = load_robot("toa")
TEXT = (
    "Hello, today we walk along the river and count the boats that pass, and then we go on to the old "
    "market, where people sell bread and flowers, and in the evening we sit by the fire and tell stories. "
)
TICKS_PER_RADIAN = find_model(ROBOT.servos[0].model).ticks_per_radian
FAST = 0.8
"""A joint this fast is in full swing [rad/s]."""

SHARE = 0.7
"""A joint brakes from the first goal on that slows it with this share of its acceleration limit."""


class ListeningWire(VirtualWire):
    """Keeps when each goal came, and the (j,) goals."""

    def __init__(self) -> None:
        super().__init__(map(VirtualServo, servo_specs(ROBOT)))
        self.goals: list[tuple[float, list[int]]] = []
        self._address = next(iter(self.servos.values())).model.table["Goal Position"].address

    def _broadcast(self, instruction: int, parameters: bytes) -> bytes:
        if instruction == INST_SYNC_WRITE and int.from_bytes(parameters[:2], "little") == self._address:
            row = {
                parameters[at]: signed(int.from_bytes(parameters[at + 1 : at + 5], "little"), 4)
                for at in range(4, len(parameters), 5)
            }
            if len(row) == len(ROBOT.servos):
                self.goals.append((time.monotonic(), [row[servo.id] for servo in ROBOT.servos]))
        return super()._broadcast(instruction, parameters)

    def lately(self, begin: float) -> tuple[np.ndarray, np.ndarray]:
        """(n,) moments since one, and (n, j) goals [rad]."""
        entries = [entry for entry in self.goals[-400:] if entry[0] > begin]
        goals = np.array([goals for _, goals in entries], float).reshape(-1, len(ROBOT.joints))
        return np.array([at for at, _ in entries]), goals / TICKS_PER_RADIAN


@contextmanager
def listening_bus() -> Iterator[tuple[ListeningWire, str]]:
    wire = ListeningWire()
    servos_end, port = open_pseudo_terminal()
    stop_reading, stop = os.pipe()
    thread = threading.Thread(target=serve, args=({servos_end: wire}, stop_reading))
    thread.start()
    try:
        yield wire, port
    finally:
        os.close(stop)
        thread.join()
        os.close(stop_reading)
        os.close(servos_end)


def first_braking_goal(times: np.ndarray, goals: np.ndarray, asked: float) -> float:
    """The moment from which on the joint that was fastest slows evenly to a stand."""
    at = int(np.searchsorted(times, asked))
    steps = np.diff(goals, axis=0)
    joint = int(np.abs(steps[at - 6 : at - 1]).mean(axis=0).argmax())
    speeds = np.abs(steps[:, joint])
    tick = float(np.median(np.diff(times)))
    slower = SHARE * ROBOT.limits.acceleration[joint] * tick**2
    stands = int(np.flatnonzero(speeds > 1.0 / TICKS_PER_RADIAN)[-1]) + 1
    for first in range(at - 1, stands):
        rest = speeds[first + 1 : stands + 1]
        allowed = speeds[first] - slower * np.arange(1, len(rest) + 1) + 1.5 / TICKS_PER_RADIAN
        if (rest <= np.maximum(allowed, 1.5 / TICKS_PER_RADIAN)).all():
            return float(times[min(first + 2, len(times) - 1)])
    return float(times[min(stands + 1, len(times) - 1)])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=50)
    options = parser.parse_args()
    demo_database()
    rclpy.init()
    node = rclpy.create_node("hand_on_the_button")
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    say = node.create_publisher(String, "say", PLAN)
    topic = node.create_publisher(Bool, "stop", PLAN)
    service, reset = (node.create_client(Trigger, name) for name in ("stop", "reset"))
    random = np.random.default_rng(0)
    took: dict[str, list[float]] = {"topic": [], "service": []}

    def spin(length: float) -> None:
        end = time.monotonic() + length
        while time.monotonic() < end:
            executor.spin_once(timeout_sec=0.01)

    with (
        tempfile.TemporaryDirectory() as folder,
        listening_bus() as (wire, port),
        running_graph(Path(folder) / "graph.log", f"port:={port}"),
    ):
        while not (wire.goals and say.get_subscription_count() and service.service_is_ready()):
            spin(0.1)
        said = -np.inf
        for trial in tqdm(range(options.trials), unit="stop", disable=None):
            while True:
                if time.monotonic() > said + 12.0:
                    said = time.monotonic()
                    say.publish(String(data=TEXT))
                spin(random.uniform(0.02, 0.06))
                times, goals = wire.lately(time.monotonic() - 0.1)
                if len(times) > 5 and np.ptp(goals, axis=0).max() > FAST * (times[-1] - times[0]):
                    break
            how = ("topic", "service")[trial % 2]
            asked = time.monotonic()
            if how == "topic":
                topic.publish(Bool(data=True))
            else:
                service.call_async(Trigger.Request())
            spin(1.0)
            took[how].append(first_braking_goal(*wire.lately(asked - 0.1), asked) - asked)
            executor.spin_until_future_complete(reset.call_async(Trigger.Request()), 5.0)
            spin(1.5)
    node.destroy_node()
    rclpy.shutdown()
    result: dict[str, float] = {}
    for how, values in took.items():
        median, p95 = np.percentile(values, [50, 95])
        result |= {f"{how}_ms_median": median, f"{how}_ms_p95": p95, f"{how}_ms_max": max(values)}
    report = {
        "bench": "stop",
        **{name: round(1e3 * value, 1) for name, value in result.items()},
        "over_50_ms": sum(value > 0.05 for values in took.values() for value in values),
        "trials": options.trials,
        "machine": machine(),
    }
    print(json.dumps(report))


if __name__ == "__main__":
    main()
