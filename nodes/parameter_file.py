"""Parameter files of ROS 2 (YAML): rcl passes over what is not there, here it is an error."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import yaml
from pydantic import AfterValidator, BaseModel, ConfigDict, RootModel
from rclpy.node import Node

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.files import read_yaml
from gesture_bot.nodes.graph import ARGUMENTS, NODES

ANY = ("*", "**")
_KINDS = {bool: "true or false", int: "a whole number"}
"""Types that are not converted, in words."""


def _known_node(key: str) -> str:
    names = [node.name for node in NODES]
    if _name(key) not in (*names, *ANY):
        raise InvalidValueError("no such node", key, names)
    return key


def _no_argument(name: str) -> str:
    if name in [argument.name for argument in ARGUMENTS]:
        raise ValueError(f"several nodes may need it: give {name}:=... instead")
    return name


class _Entry(BaseModel):
    model_config = ConfigDict(extra="forbid")

    ros__parameters: dict[Annotated[str, AfterValidator(_no_argument)], Any]


class _File(RootModel[dict[Annotated[str, AfterValidator(_known_node)], _Entry]]):
    pass


def check_file(path: Path) -> None:
    """Look through a file that a user gives for the whole graph.

    Raises:
        FileFormatError: It cannot be read, is no parameter file, names a node that is not of the graph, or
            sets an argument of the graph; tells the line.
    """
    read_yaml(path, _File)


def check_parameters(node: Node, files: Sequence[str]) -> None:
    """Look whether a node has each parameter that a file sets for it by its name, and has taken the value.

    Where an earlier file has the same parameter as true or false, or as a whole number, rcl passes over a
    value of another type.

    Raises:
        InvalidValueError: It has not; lists its parameters. Or the value is of another type.
    """
    for file in files:
        for key, entry in (yaml.safe_load(Path(file).read_text()) or {}).items():
            if _name(key) == node.get_name():
                for name, value in entry.get("ros__parameters", {}).items():
                    if not node.has_parameter(name):
                        valid = sorted(node.list_parameters([], 0).names)
                        raise InvalidValueError(f"{file}: {node.get_name()} has no parameter", name, valid)
                    what = _KINDS.get(type(taken := node.get_parameter(name).value))
                    if what and type(value) is not type(taken):
                        told = f"{file}: parameter {name} of {node.get_name()} takes {what}"
                        raise InvalidValueError(told, value)


def _name(key: str) -> str:
    """The node that a key such as /**/servo_driver means."""
    return key.rpartition("/")[2]
