"""What a type of message looks like, in the words of ROS 2: its definition and its hash."""

import importlib
import json
import re
from pathlib import Path
from typing import Any

from gesture_bot.base.errors import FileFormatError

SEPARATOR = "=" * 80


def message_class(name: str) -> Any:
    """The class of a type such as `sensor_msgs/msg/JointState`.

    Raises:
        FileFormatError: Its package is not installed, or has no such message.
    """
    try:
        package, kind, type_name = name.split("/")
        return getattr(importlib.import_module(f"{package}.{kind}"), type_name)
    except (ValueError, ImportError, AttributeError) as error:
        raise FileFormatError("no installed package has the message type", name) from error


def message_definition(name: str) -> str:
    """The .msg file of a type, and behind it those of all types inside it, as rosbag2 writes them (ros2msg).

    Raises:
        FileFormatError: A type is not installed.
    """
    parts: list[str] = []
    waiting, seen = [name], {name}
    while waiting:
        current = waiting.pop(0)
        text = _installed(current, ".msg").read_text()
        package, _, type_name = current.split("/")
        parts.append(f"MSG: {package}/{type_name}\n{text}" if parts else text)
        for field in message_class(current).get_fields_and_field_types().values():
            for inner_package, inner_type in re.findall(r"(\w+)/(\w+)", field):
                inner = f"{inner_package}/msg/{inner_type}"
                if inner not in seen:
                    seen.add(inner)
                    waiting.append(inner)
    return f"\n{SEPARATOR}\n".join(parts)


def type_hash(name: str) -> str:
    """The hash that ROS 2 gives to a type and all types inside it (REP-2011).

    Raises:
        FileFormatError: The type is not installed.
    """
    described = json.loads(_installed(name, ".json").read_text())
    return next(entry["hash_string"] for entry in described["type_hashes"] if entry["type_name"] == name)


def _installed(name: str, ending: str) -> Path:
    """A file of a type in the share folder of its package."""
    package, kind, type_name = name.split("/")
    message_class(name)
    module = Path(str(importlib.import_module(f"{package}.{kind}").__file__))
    for folder in module.parents:
        path = folder / "share" / package / kind / f"{type_name}{ending}"
        if path.is_file():
            return path
    raise FileFormatError(f"the installed package lacks the {ending} file of the message type", name)
