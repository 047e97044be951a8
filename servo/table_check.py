"""Can the servos of a robot's table do what its joints ask for, as far as can be told without them."""

from collections.abc import Iterator

from gesture_bot.base.errors import RobotError
from gesture_bot.retarget.robot import Robot
from gesture_bot.servo.models import BAUD_RATES, MODELS, RPM
from gesture_bot.servo.table import ServoTable, series_of


def table_problems(robot: Robot) -> Iterator[str]:
    """What does not fit, a line each: baud rate, models, several series, ranges over a turn, speeds."""
    rates = sorted(BAUD_RATES.values())
    if robot.bus.baudrate not in rates:
        yield f"no servo speaks at {robot.bus.baudrate} bit/s, but at {', '.join(map(str, rates))}"
    unknown = sorted({servo.model for servo in robot.servos} - MODELS.keys())
    if unknown:
        yield f"unknown models: {', '.join(unknown)}; valid: {', '.join(MODELS)}"
        return
    try:
        series_of(robot)
    except RobotError as error:
        yield str(error)
    table = ServoTable(robot)
    ends = zip(table.ticks(robot.limits.lower), table.ticks(robot.limits.upper), strict=True)
    for servo, speed, pair in zip(robot.servos, robot.limits.velocity, ends, strict=True):
        model = MODELS[servo.model]
        if min(pair) < model.first or max(pair) > model.last:
            has = f"and has {model.first} to {model.last}"
            yield f"{servo.joint} needs ticks {min(pair)} to {max(pair)}, {has}"
        fastest = model.speed * RPM
        if speed > fastest:
            yield f"{servo.joint} may turn at {speed:.1f} rad/s, {servo.model} at no more than {fastest:.1f}"
