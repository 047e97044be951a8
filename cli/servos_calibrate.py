"""`gesture-bot servos calibrate`: the joints are moved to their marks by hand, one after the other."""

import argparse
import contextlib
import math
import shlex
from collections.abc import Sequence

from rich.live import Live
from rich.text import Text

from gesture_bot.base.errors import InvalidValueError, RobotError
from gesture_bot.cli.servo_bus import answer, open_robot, release
from gesture_bot.retarget.robot import Robot, ServoEntry
from gesture_bot.servo.bus import Bus
from gesture_bot.servo.buses import RobotBus
from gesture_bot.servo.calibration import calibrate, read_angle, save_homings, saved_homings
from gesture_bot.servo.preparation import check_servos
from gesture_bot.servo.settings import read_homing


def command(options: argparse.Namespace) -> int:
    """Guide somebody through the calibration of all joints, or of those named, or undo the last one.

    Returns:
        The exit status.

    Raises:
        GestureBotError: There is no such robot, joint or port; a servo does not answer; nothing to undo.
    """
    with open_robot(options) as (robot, bus):
        servos = _chosen(robot, options.joints)
        saved = saved_homings(robot) if options.undo else {}
        check_servos(bus, robot)
        release(bus, [servo.id for servo in servos])
        now = {servo.joint: read_homing(bus.of(servo.id), servo.id) for servo in robot.servos}
        if options.undo:
            save_homings(robot, now)
            for servo in servos:
                _go_back(bus.of(servo.id), servo, now[servo.joint], saved.get(servo.joint, now[servo.joint]))
            return 0
        done = _guide(bus, robot, servos, now)
    print(f"{done} of {len(servos)} joints calibrated")
    if done:
        same = shlex.join([options.robot, *(["--port", options.port] if options.port else [])])
        print(f"next: gesture-bot servos check {same}")
        print(f"back: gesture-bot servos calibrate {same} --undo")
    return 0


def _chosen(robot: Robot, joints: Sequence[str]) -> list[ServoEntry]:
    for joint in joints:
        if joint not in robot.joints:
            raise InvalidValueError(f"{robot.name} has no joint", joint, robot.joints)
    return [servo for servo in robot.servos if not joints or servo.joint in joints]


def _go_back(bus: Bus, servo: ServoEntry, now: int, before: int) -> None:
    if before != now:
        bus.write(servo.id, "Homing Offset", before)
    print(f"{servo.joint}: homing offset {now} -> {before}")


def _guide(bus: RobotBus, robot: Robot, servos: Sequence[ServoEntry], homings: dict[str, int]) -> int:
    """How many joints were calibrated; with the first, the `homings` before it are kept, to go back to."""
    print("Enter: the joint is at its mark; s: leave this joint as it is; q or Ctrl-C: end here", flush=True)
    done, waiting = 0, list(servos)
    with contextlib.suppress(KeyboardInterrupt):
        while waiting:
            servo = waiting[0]
            match _wait(bus.of(servo.id), servo):
                case "q":
                    break
                case "s":
                    waiting.pop(0)
                case "":
                    if not done:
                        save_homings(robot, homings)
                    try:
                        before, after = calibrate(bus.of(servo.id), robot, servo)
                    except RobotError as error:
                        print(error, flush=True)
                        continue
                    print(f"{servo.joint}: homing offset {before} -> {after}", flush=True)
                    done += 1
                    waiting.pop(0)
    return done


def _wait(bus: Bus, servo: ServoEntry) -> str:
    """What somebody types while they see where the joint is."""
    mark = f"Move {servo.joint} (servo {servo.id}) to its mark, {math.degrees(servo.mark):z.1f} deg"
    with Live(Text(mark), transient=True) as live:

        def show() -> None:
            live.update(Text(f"{mark}; it is at {math.degrees(read_angle(bus, servo)):z.1f} deg"))

        return answer(show)
