"""Reading a URDF file, with clear words for what is wrong with one."""

import math
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import NamedTuple

from gesture_bot.base.errors import RobotError


def read_urdf(path: Path) -> str:
    """The XML of a URDF file.

    Raises:
        RobotError: It cannot be read, is no URDF, links and joints cannot be told apart by their names, or a
            limit or an origin is not made of numbers.
    """
    try:
        text = path.read_text(encoding="utf-8")
        root = ElementTree.fromstring(text)
    except (OSError, UnicodeDecodeError, ElementTree.ParseError) as error:
        reason = (isinstance(error, OSError) and error.strerror) or error
        raise RobotError(f"cannot read the URDF {path} ({reason})") from error
    if root.tag != "robot":
        raise RobotError(f"{path} is not a URDF: its root element is", root.tag, ["robot"])
    if any(element.tag.partition("}")[0].endswith("/xacro") for element in root.iter()):
        raise RobotError(f"{path} is for xacro, which makes a URDF of it: run xacro first")
    for kind in ("link", "joint"):
        _check_names(path, kind, root.findall(kind))
    for joint in root.findall("joint"):
        _check_limit(path, joint)
    for element in (*root.findall("link"), *root.findall("joint")):
        _check_origins(path, element)
    return text


class JointRange(NamedTuple):
    """What a URDF says of a joint [rad, rad/s]; infinite where it says nothing."""

    lower: float
    upper: float
    velocity: float


def joint_range(joint: ElementTree.Element) -> JointRange:
    """The range of a joint. A velocity of zero is one that nobody has filled in."""
    limit = joint.find("limit")
    given = {} if limit is None else limit.attrib
    velocity = float(given.get("velocity", 0))
    if joint.get("type") == "continuous":
        given = {}
    return JointRange(
        float(given.get("lower", -math.inf)),
        float(given.get("upper", math.inf)),
        velocity if velocity > 0 else math.inf,
    )


def _check_names(path: Path, kind: str, elements: list[ElementTree.Element]) -> None:
    names = [element.get("name", "") for element in elements]
    if kind == "link" and not names:
        raise RobotError(f"{path} has no links")
    if not all(names):
        raise RobotError(f"{path}: a {kind} has no name, the one after", ([""] + names)[names.index("")])
    doubled = sorted({name for name in names if names.count(name) > 1})
    if doubled:
        raise RobotError(f"{path}: two {kind}s are called", doubled[0])


def _check_limit(path: Path, joint: ElementTree.Element) -> None:
    limit = joint.find("limit")
    for key, value in ({} if limit is None else limit.attrib).items():
        try:
            float(value)
        except ValueError as error:
            raise RobotError(f"{path}: {key} of {joint.get('name')} is not a number", value) from error


def _check_origins(path: Path, element: ElementTree.Element) -> None:
    for origin in element.iter("origin"):
        for key in ("xyz", "rpy"):
            value = origin.get(key, "0 0 0")
            try:
                numbers = [float(word) for word in value.split()]
            except ValueError:
                numbers = []
            if len(numbers) != 3:
                name = f"the {element.tag} {element.get('name')}"
                raise RobotError(f"{path}: {key} of an origin in {name} is not three numbers", value)
