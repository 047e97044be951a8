"""Calibration: a joint is moved to its mark by hand, and its servo's Homing Offset (20) is set to fit."""

import json
import math
import time
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from gesture_bot.base.errors import FileFormatError, RobotError
from gesture_bot.base.files import state_dir, write_whole
from gesture_bot.retarget.robot import Robot, ServoEntry
from gesture_bot.servo.bus import Bus
from gesture_bot.servo.models import find_model, signed
from gesture_bot.servo.settings import fits_turn, read_homing
from gesture_bot.servo.table import joint_angle

SAMPLES, INTERVAL = 10, 0.03
"""A joint that is held still is measured so many times, so far apart [s]."""

NOT_THERE = "is it at its mark? If so"

STILL = math.radians(0.7)
"""How far it may move meanwhile [rad]."""


def read_angle(bus: Bus, servo: ServoEntry) -> float:
    """Where a joint stands [rad].

    Raises:
        BusError: Its servo does not answer.
    """
    return joint_angle(servo, signed(bus.read(servo.id, "Present Position"), 4))


def calibrate(bus: Bus, robot: Robot, servo: ServoEntry) -> tuple[int, int]:
    """Take it that a joint stands at its mark now: set its servo's Homing Offset. The torque must be off.

    Returns:
        Homing Offset before and after [ticks].

    Raises:
        RobotError: The joint moves, or stands so that no Homing Offset can be right.
        BusError: The servo does not answer, or refuses.
    """
    before = read_homing(bus, servo.id)
    counted = before if abs(before) <= find_model(servo.model).homing_range else 0
    after = _homing(robot, servo, _still_position(bus, servo) - counted)
    if after != before:
        bus.write(servo.id, "Homing Offset", after)
    return before, after


def save_homings(robot: Robot, homings: Mapping[str, int]) -> None:
    """Keep the Homing Offsets of a robot's joints [ticks], to go back to.

    Raises:
        FileFormatError: They cannot be written.
    """
    with write_whole(_path(robot)) as path:
        path.write_text(json.dumps(dict(homings), indent=1), encoding="utf-8")


def saved_homings(robot: Robot) -> dict[str, int]:
    """The Homing Offsets that were kept last [ticks], by joint.

    Raises:
        FileFormatError: None were kept, or their file is damaged.
    """
    path = _path(robot)
    try:
        kept = json.loads(path.read_text(encoding="utf-8"))
        return {str(joint): int(offset) for joint, offset in kept.items()}
    except FileNotFoundError as error:
        raise FileFormatError(f"nothing to undo: {robot.name} was not calibrated on this computer") from error
    except (OSError, ValueError, TypeError, AttributeError) as error:
        raise FileFormatError(f"cannot read {path} ({error})") from error


def _still_position(bus: Bus, servo: ServoEntry) -> int:
    """Present Position (132) of a joint that is held still [ticks]."""
    positions = []
    for _ in range(SAMPLES):
        positions.append(signed(bus.read(servo.id, "Present Position"), 4))
        time.sleep(INTERVAL)
    if np.ptp(positions) > STILL * find_model(servo.model).ticks_per_radian:
        raise RobotError(f"{servo.joint} moves: hold it still")
    return round(float(np.median(positions)))


def _homing(robot: Robot, servo: ServoEntry, encoder: int) -> int:
    """The Homing Offset with which a joint is at its mark where its encoder reads so much [ticks].

    Moved by hand, the encoder counts on beyond its turn; when torque comes on, it is back within.
    """
    model = find_model(servo.model)
    encoder = (encoder - model.first) % model.turn + model.first
    at_mark = model.ticks(servo.direction * servo.mark + servo.offset)
    homing = at_mark - encoder
    degrees = math.degrees(homing / model.ticks_per_radian)
    off = f"{servo.joint} is {degrees:+.0f} deg from where its servo should be"
    if not fits_turn(robot, servo, homing):
        raise RobotError(
            f"{off}, and would pass the end of the servo's turn: {NOT_THERE}, mount its horn anew"
        )
    if abs(homing) > model.homing_range:
        offset = (encoder - model.centre) / model.ticks_per_radian - servo.direction * servo.mark
        raise RobotError(f"{off}, beyond 90: {NOT_THERE}, set its offset in the robot's file to {offset:.3f}")
    return homing


def _path(robot: Robot) -> Path:
    return state_dir() / f"{robot.name}.homing.json"
