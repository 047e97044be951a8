"""`gesture-bot robot`: make a mapping for a robot, and check it."""

import argparse
import os
from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.cli import STYLES
from gesture_bot.evaluate.robot_gif import write_robot_picture
from gesture_bot.retarget.checks import Finding, check_mapping
from gesture_bot.retarget.mapping_file import rewrite_rest, write_mapping
from gesture_bot.retarget.proposal import propose
from gesture_bot.retarget.rest_pose import rest_pose
from gesture_bot.retarget.robot import Robot, load_robot
from gesture_bot.retarget.urdf_file import read_urdf
from gesture_bot.servo.table_check import table_problems

MAPPINGS = (".yaml", ".yml")


def command(options: argparse.Namespace) -> int:
    """Add or check a robot, or let its arms hang anew; the exit status.

    Args:
        options: action, "add", "rest" or "check"; urdf, the URDF file to add; robot, the YAML file to change
            or check, or the name; output, the YAML file to write or the picture to draw, or None.

    Raises:
        GestureBotError: A file cannot be read or written, or no mapping is found.
    """
    console = Console(highlight=False, markup=False)
    if options.action == "add":
        return _add(options.urdf, options.output or Path(f"{options.urdf.stem}.yaml"), console)
    robot = load_robot(options.robot)
    if options.action == "rest":
        return _rest(robot, Path(options.robot), console)
    bad = _print_findings(robot, console)
    if options.output:
        _draw(robot, options.output, console)
    return int(bad)


def _add(urdf: Path, output: Path, console: Console) -> int:
    xml = read_urdf(urdf)
    if output.suffix not in MAPPINGS:
        raise InvalidValueError("cannot write a mapping into this kind of file", output.name, MAPPINGS)
    picture = output.with_suffix(".png")
    for path in (output, picture):
        if path.exists():
            raise InvalidValueError("will not write over a file; choose another name with -o", str(path))
    description = propose(urdf.stem, xml, os.path.relpath(urdf, output.parent))
    write_mapping(output, description)
    robot = load_robot(str(output))
    _print_findings(robot, console)
    console.print(f"wrote {output}", soft_wrap=True)
    _draw(robot, picture, console)
    console.print(
        f"\nLook at the picture, correct {output.name}, then: gesture-bot robot check {output}\n"
        f"After you have corrected links, the arms hang anew with: gesture-bot robot rest {output}\n"
        "The servos in it are made up. They move on the virtual bus; put in your own for a real one.",
        soft_wrap=True,
    )
    return 0


def _rest(robot: Robot, path: Path, console: Console) -> int:
    if path.suffix not in MAPPINGS:
        raise InvalidValueError("cannot write a rest pose into this kind of file", path.name, MAPPINGS)
    proposed = rest_pose(robot)
    changed = {
        joint: angle
        for joint, before, angle in zip(robot.joints, robot.rest, proposed.tolist(), strict=True)
        if angle != before
    }
    rewrite_rest(path, changed)
    bad = _print_findings(load_robot(str(path)), console)
    console.print(f"changed rest angles in {path}: {', '.join(changed) or 'none'}", soft_wrap=True)
    return int(bad)


def _print_findings(robot: Robot, console: Console) -> bool:
    """Print a table; whether anything is bad."""
    findings = check_mapping(robot)
    problems = list(table_problems(robot))
    findings += [Finding("servos", "bad", problem) for problem in problems]
    if not problems:
        ids = sorted(servo.id for servo in robot.servos)
        findings.append(Finding("servos", "ok", f"{len(ids)}, ids {ids[0]} to {ids[-1]}"))
    table = Table("check", "", "", box=None, pad_edge=False, show_header=False)
    for finding in findings:
        table.add_row(Text(finding.check), Text(finding.state, STYLES[finding.state]), Text(finding.text))
    console.print(table)
    states = [finding.state for finding in findings]
    look, bad = states.count("look"), states.count("bad")
    console.print(f"{look} to look at, {bad} bad" if look or bad else "all is well")
    return bad > 0


def _draw(robot: Robot, picture: Path, console: Console) -> None:
    if picture.suffix != ".png":
        raise InvalidValueError("cannot draw into this kind of file", picture.name, [".png"])
    write_robot_picture(picture, robot, robot.rest)
    console.print(f"drew its rest pose into {picture}", soft_wrap=True)
