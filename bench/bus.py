"""How evenly the driver keeps its 100 Hz with 14 servos at 1 Mbps, on the virtual bus, in real time.

`make bench-bus`; the last line is one JSON object. The virtual bus is a process of its own, and lets each
byte take its time on the wire. Two cores are needed for a fair figure.
"""

import argparse
import json
import sys
import time
from dataclasses import replace

import numpy as np
import psutil
from machine import machine
from tqdm import tqdm

from gesture_bot.base.trajectory import JointTrajectory
from gesture_bot.retarget.follower import JointLimits
from gesture_bot.retarget.robot import Robot, load_robot
from gesture_bot.servo.driver import Driver
from gesture_bot.servo.virtual_bus import VirtualBus

RATE = 100.0
SERVOS = 14
BAUDRATE = 1_000_000


def robot_with(servos: int, buses: int) -> Robot:
    """toa, with more servos like its wrists', on one bus or on several in turn."""
    robot = load_robot("toa")
    like = robot.joints.index("left_wrist")
    extra = range(servos - len(robot.joints))
    limits, chosen = robot.limits, [*range(len(robot.joints)), *[like for _ in extra]]
    names = (*robot.joints, *(f"hand_{i}" for i in extra))
    hands = "".join(
        f'<link name="hand_{i}_link"/><joint name="hand_{i}" type="revolute"><parent link="left_hand"/>'
        f'<child link="hand_{i}_link"/><limit lower="-2" upper="2" velocity="5" effort="1"/></joint>'
        for i in extra
    )
    return replace(
        robot,
        urdf=robot.urdf.replace("</robot>", f"{hands}</robot>"),
        limits=JointLimits(
            names,
            limits.lower[chosen],
            limits.upper[chosen],
            limits.velocity[chosen],
            limits.acceleration[chosen],
        ),
        rest=robot.rest[chosen],
        servos=tuple(
            replace(servo, bus=f"bus_{at % buses}")
            for at, servo in enumerate(
                (
                    *robot.servos,
                    *(replace(robot.servos[like], joint=f"hand_{i}", id=100 + i) for i in extra),
                )
            )
        ),
        bus=robot.bus.model_copy(update={"baudrate": BAUDRATE, "on_exit": "off"}),
    )


def swing(robot: Robot, begin: float, seconds: float) -> JointTrajectory:
    times = begin + np.arange(0.0, seconds + 2.0, 0.02)
    phase = np.pi * (times - begin)[:, None]
    size = np.where(robot.limits.upper - robot.rest > 0.6, 0.25, -0.25)
    return JointTrajectory(
        robot.joints,
        times,
        robot.rest + size * (1.0 - np.cos(phase)),
        np.pi * size * np.sin(phase),
    )


def measure(seconds: float, buses: int) -> dict[str, object]:
    robot = robot_with(SERVOS, buses)
    sys.setswitchinterval(5e-4)  # as the node has it
    with VirtualBus(robot) as bus:
        driver = Driver(robot, bus.port, RATE)
        driver.start()
        driver.set_trajectory(swing(robot, time.time(), seconds))
        process = psutil.Process()
        busy, began = sum(process.cpu_times()[:2]), time.monotonic()
        asked, took = [], []
        due = began
        for _ in tqdm(range(round(seconds * RATE)), unit="cycle"):
            time.sleep(max(0.0, due - time.monotonic()))
            tick = time.monotonic()
            asked.append(driver.tick(time.time()).stamp)
            took.append(1000 * (time.monotonic() - tick))
            due = max(due + 1.0 / RATE, time.monotonic())
        wall = time.monotonic() - began
        busy = sum(process.cpu_times()[:2]) - busy
        status = driver.status
        driver.close()
    error = 1000 * np.abs(np.diff(asked) - 1.0 / RATE)
    return {
        "servos": SERVOS,
        "buses": buses,
        "baudrate": BAUDRATE,
        "rate_hz": round(len(asked) / wall, 2),
        "period_error_ms": {f"p{p}": round(float(np.percentile(error, p)), 3) for p in (50, 95, 99, 100)},
        "tick_ms": {f"p{p}": round(float(np.percentile(took, p)), 3) for p in (50, 99)},
        "late_cycles": status.late_cycles,
        "read_failures": status.read_failures,
        "silent": list(status.out),
        "blocks": status.blocks,
        "cpu_share": round(busy / wall, 3),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0, help="length of the run [s]")
    parser.add_argument("--buses", type=int, default=1, help="how many the servos are spread over")
    options = parser.parse_args()
    result = measure(options.seconds, options.buses)
    print(json.dumps({**result, "machine": machine()}))


if __name__ == "__main__":
    main()
