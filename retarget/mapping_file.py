"""A robot's description as a YAML file that explains itself, for people to correct."""

from collections.abc import Mapping
from pathlib import Path

import yaml

from gesture_bot.base.errors import FileFormatError
from gesture_bot.base.files import read_text, write_whole
from gesture_bot.retarget.description import Arm, Joint, RobotDescription

_HEAD = """\
# {name}: how people's keypoints map to its links, and which servo turns which joint.
# Proposed from the URDF alone. Correct it, then: gesture-bot robot check {file}
# toa.yaml, which comes with gesture_bot (config/robots), explains all keys, and those that are not here:
# mark of a joint; warm_degc, hot_degc, on_fault and on_stop of the bus.
urdf: {urdf}

# Links whose frames stand for parts of the human body. Axes are unit vectors in the link's own frame.
mapping:
  torso: {torso}
  forward: {forward}   # of the torso
  up: {up}
  head:
    link: {head}
    forward: {face}   # where the face looks
"""

_JOINTS = """
# Per joint: the servo (id, model, direction +1 or -1, offset [rad]: servo angle = direction * joint angle
# + offset), rest [rad], acceleration limit [rad/s^2]; lower, upper [rad] and velocity [rad/s], if given,
# narrow the URDF's limits.
# THE SERVOS ARE MADE UP: they move on the virtual bus. Put in your robot's own before you connect it.
joints:
"""

_BUS = """
bus:
  baudrate: {baudrate}        # [bit/s]
  protocol: {protocol:.1f}
  lag_ms: {lag_ms:g}                # servos are so far behind their goals [ms]
  watchdog_ms: {watchdog_ms}         # a servo that hears nothing for so long stops by itself
  on_exit: {on_exit}   # or hold (torque stays on), or off (torque goes off at once)
"""


def write_mapping(path: Path, description: RobotDescription) -> None:
    """Write a description to a YAML file.

    Raises:
        FileFormatError: It cannot be written.
    """
    mapping = description.mapping
    text = _HEAD.format(
        name=path.stem,
        file=path.name,
        urdf=_word(description.urdf),
        torso=_word(mapping.torso),
        forward=_row(mapping.forward),
        up=_row(mapping.up),
        head=_word(mapping.head.link),
        face=_row(mapping.head.forward),
    )
    text += _arm("left_arm", mapping.left_arm) + _arm("right_arm", mapping.right_arm) + _JOINTS
    width = max(len(_word(name)) for name in description.joints) + 1
    for name, joint in description.joints.items():
        text += f"  {_word(name) + ':':{width}} {_joint(joint)}\n"
    text += _BUS.format(**description.bus.model_dump())
    with write_whole(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def rewrite_rest(path: Path, rest: Mapping[str, float]) -> None:
    """Change the rest angles in a description's file, and nothing else in it: comments stay.

    Args:
        path: The YAML file.
        rest: Angles by joint [rad].

    Raises:
        FileFormatError: It cannot be read or written, or a joint's line gives no rest angle.
    """
    text = read_text(path)
    places = []
    rows = _items(_items(yaml.compose(text, yaml.SafeLoader))["joints"])
    for joint, angle in rest.items():
        place = _items(rows[joint]).get("rest")
        if place is None:
            raise FileFormatError(f"{path} gives no rest angle in the line of", joint)
        places.append((place.start_mark.index, place.end_mark.index, f"{angle:.5g}"))
    for begin, end, written in sorted(places, reverse=True):
        text = text[:begin] + written + text[end:]
    with write_whole(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _items(node: yaml.Node | None) -> dict[str, yaml.Node]:
    return {key.value: value for key, value in node.value} if node else {}


def _arm(name: str, arm: Arm) -> str:
    lines = [
        f"  {name}:",
        f"    shoulder: {_word(arm.shoulder)}   # the upper arm points from this link's origin",
        f"    elbow: {_word(arm.elbow)}   # to this one's, the forearm from here",
        f"    wrist: {_word(arm.wrist)}   # to this one's",
    ]
    if any(arm.wrist_at):
        lines[-1] = f"    wrist: {_word(arm.wrist)}   # to a point in this link's frame,"
        lines.append(f"    wrist_at: {_row(arm.wrist_at)}   # this one [m]")
    lines += [
        f"    hand: {_word(arm.hand)}   # the link that turns with the palm",
        f"    palm: {_row(arm.palm)}   # out of the palm",
    ]
    return "\n".join(lines) + "\n"


def _joint(joint: Joint) -> str:
    given = joint.model_dump(exclude_unset=True)
    return f"{{{', '.join(f'{key}: {_value(value)}' for key, value in given.items())}}}"


def _row(vector: tuple[float, float, float]) -> str:
    return f"[{', '.join(_value(value) for value in vector)}]"


def _value(value: object) -> str:
    return f"{value:.5g}" if isinstance(value, float) else str(value)


def _word(text: str) -> str:
    """A string as YAML, in quotes where it needs them."""
    return yaml.safe_dump(text, width=1000).removesuffix("\n...\n").strip()
