"""Can the servos of a robot's table do what its joints ask for, as far as can be told without them."""

import math
from collections.abc import Iterator

from gesture_bot.retarget.robot import Robot
from gesture_bot.servo.models import BAUD_RATES, MODELS
from gesture_bot.servo.table import ServoTable

LAST_TICK = 4095
"""Highest Goal Position (116) in position control over one turn."""


def table_problems(robot: Robot) -> Iterator[str]:
    """What does not fit, a line each: baud rate, models, ranges over a servo's turn, speeds over its own."""
    rates = sorted(BAUD_RATES.values())
    if robot.bus.baudrate not in rates:
        yield f"no servo speaks at {robot.bus.baudrate} bit/s, but at {', '.join(map(str, rates))}"
    unknown = sorted({servo.model for servo in robot.servos} - MODELS.keys())
    if unknown:
        yield f"unknown models: {', '.join(unknown)}"
        return
    table = ServoTable(robot)
    ends = zip(table.ticks(robot.limits.lower), table.ticks(robot.limits.upper), strict=True)
    for servo, speed, pair in zip(robot.servos, robot.limits.velocity, ends, strict=True):
        if min(pair) < 0 or max(pair) > LAST_TICK:
            yield f"{servo.joint} needs ticks {min(pair)} to {max(pair)}, and has 0 to {LAST_TICK}"
        fastest = MODELS[servo.model].speed * 2 * math.pi / 60
        if speed > fastest:
            yield f"{servo.joint} may turn at {speed:.1f} rad/s, {servo.model} at no more than {fastest:.1f}"
