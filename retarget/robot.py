"""A robot: its URDF, what its joints may do, and which servos turn them."""

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gesture_bot.base.errors import InvalidValueError, RobotError
from gesture_bot.base.files import config_dir, read_yaml
from gesture_bot.retarget.description import Bus, Joint, Mapping, RobotDescription
from gesture_bot.retarget.follower import JointLimits
from gesture_bot.retarget.urdf_file import joint_range, read_urdf


@dataclass(frozen=True)
class ServoEntry:
    """A row of the servo table: servo angle = direction * joint angle + offset [rad].

    Attributes:
        joint: Joint name.
        id: Dynamixel ID.
        model: Dynamixel model name.
        direction: +1 or -1.
        offset: [rad].
        mark: Joint angle at which the joint stands when it is calibrated [rad].
        bus: Name of the bus that the servo is on; empty where there is but one.
    """

    joint: str
    id: int
    model: str
    direction: int
    offset: float
    mark: float = 0.0
    bus: str = ""


@dataclass(frozen=True)
class Robot:
    """A robot whose URDF, mapping and servo table fit together.

    Attributes:
        name: Name of its YAML file, without the ending.
        urdf: The URDF, as XML.
        limits: What the joints may do; position limits are the narrower of URDF and YAML.
        rest: (j,) the rest pose, inside the limits [rad].
        mapping: Links that stand for the human body.
        servos: The servo table, one row a joint.
        bus: The servo bus.
        folder: Where the URDF is, from where its meshes are looked for; None where that is not known.
    """

    name: str
    urdf: str
    limits: JointLimits
    rest: np.ndarray
    mapping: Mapping
    servos: tuple[ServoEntry, ...]
    bus: Bus
    folder: Path | None = None

    @property
    def joints(self) -> tuple[str, ...]:
        """The j joint names, in the servo table's order."""
        return self.limits.joints

    @property
    def buses(self) -> tuple[str, ...]:
        """Names of the servo buses; of the only one it may be empty."""
        return tuple(dict.fromkeys(servo.bus for servo in self.servos))


def robot_names() -> list[str]:
    """Names of the robots that come with the package."""
    return sorted(path.stem for path in (config_dir() / "robots").glob("*.yaml"))


def load_robot(name_or_path: str) -> Robot:
    """Load a robot by its name (`toa`) or by the path of its YAML file.

    Raises:
        InvalidValueError: No robot has this name; lists the known ones.
        FileFormatError: The YAML file cannot be read, or a value in it does not fit.
        RobotError: The URDF cannot be read, lacks a joint or link that the YAML names, or gives no range.
    """
    path = Path(name_or_path)
    if path.suffix not in (".yaml", ".yml"):
        if name_or_path not in robot_names():
            raise InvalidValueError("no such robot, nor a path ending in .yaml", name_or_path, robot_names())
        path = config_dir() / "robots" / f"{name_or_path}.yaml"
    description = read_yaml(path, RobotDescription)
    urdf = path.parent / description.urdf
    return replace(assemble(path.stem, read_urdf(urdf), description), folder=urdf.parent)


def assemble(name: str, urdf: str, description: RobotDescription) -> Robot:
    """Put a URDF, as XML, and the rest of a robot's description together.

    Raises:
        RobotError: The URDF lacks a joint or link that the description names, or gives no range.
    """
    root = ElementTree.fromstring(urdf)
    links = [link.get("name", "") for link in root.iter("link")]
    for link in description.mapping.links():
        if link not in links:
            raise RobotError(f"{name} maps a link that the URDF {description.urdf} lacks", link, links)
    limits = _limits(root, description)
    rest = np.array([joint.rest for joint in description.joints.values()])
    for joint, angle, lower, upper in zip(limits.joints, rest, limits.lower, limits.upper, strict=True):
        if not lower <= angle <= upper:
            raise RobotError(
                f"{name}: the rest angle of {joint} is outside {lower:g} to {upper:g} rad", float(angle)
            )
    servos = tuple(
        ServoEntry(
            joint,
            row.id,
            row.model,
            row.direction,
            row.offset,
            float(np.clip(0.0, lower, upper)) if row.mark is None else row.mark,
            row.bus,
        )
        for (joint, row), lower, upper in zip(
            description.joints.items(), limits.lower, limits.upper, strict=True
        )
    )
    return Robot(name, urdf, limits, rest, description.mapping, servos, description.bus)


def _limits(root: ElementTree.Element, description: RobotDescription) -> JointLimits:
    elements = {joint.get("name", ""): joint for joint in root.findall("joint")}
    turning = [name for name, joint in elements.items() if joint.get("type") in ("revolute", "continuous")]
    rows = []
    for name, joint in description.joints.items():
        if name not in elements:
            message = f"the servo table has a joint that the URDF {description.urdf} lacks"
            raise RobotError(message, name, turning)
        if name not in turning:
            message = f"the servo table has a joint that is {elements[name].get('type')} in the URDF"
            raise RobotError(message, name, turning)
        rows.append(_joint_limits(name, joint, elements[name]))
    return JointLimits(tuple(description.joints), *np.array(rows).T)


def _joint_limits(name: str, joint: Joint, element: ElementTree.Element) -> tuple[float, float, float, float]:
    given = joint_range(element)
    for key, wider in (
        ("lower", -np.inf < joint.lower < given.lower),
        ("upper", np.inf > joint.upper > given.upper),
        ("velocity", np.inf > joint.velocity > given.velocity),
    ):
        if wider:
            message = f"{key} of {name} may narrow the URDF's {getattr(given, key):.5g}, and is beyond it"
            raise RobotError(message, getattr(joint, key))
    lower, upper = max(given.lower, joint.lower), min(given.upper, joint.upper)
    velocity = min(given.velocity, joint.velocity)
    if not (-np.inf < lower < upper < np.inf and 0 < velocity < np.inf):
        message = f"{name} needs limits lower < upper and a velocity > 0, of the URDF or the YAML file"
        raise RobotError(message, (lower, upper, velocity))
    return lower, upper, velocity, joint.acceleration
