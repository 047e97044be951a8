"""A URDF as a MuJoCo model, whatever its meshes: simple boxes stand for them."""

import xml.etree.ElementTree as ElementTree
from typing import Any, NamedTuple

import mujoco
import numpy as np

from gesture_bot.base.errors import RobotError

# Fixed links stay links, shapes for looks are kept, and links without inertia are let through.
_COMPILER = {
    "fusestatic": "false",
    "discardvisual": "false",
    "balanceinertia": "true",
    "boundmass": "0.001",
    "boundinertia": "0.000001",
}
LIGHTEST = 200.0
"""No link is lighter than this for its size [kg/m^3]: a box that would be is made smaller."""

_THINNEST = 0.004
"""Half the least thickness of such a box [m]."""

_COLOR = [0.62, 0.67, 0.72, 1.0]


class Mimic(NamedTuple):
    """What a joint does: multiplier * the angle of another joint + offset [rad]."""

    joint: str
    multiplier: float
    offset: float


def mimics(urdf: str) -> dict[str, Mimic]:
    """The joints of a URDF, as XML, that mimic another, by name."""
    found = {}
    for joint in ElementTree.fromstring(urdf).findall("joint"):
        mimic = joint.find("mimic")
        if mimic is not None:
            multiplier, offset = float(mimic.get("multiplier", 1)), float(mimic.get("offset", 0))
            found[joint.get("name", "")] = Mimic(mimic.get("joint", ""), multiplier, offset)
    return found


def urdf_model(name: str, urdf: str) -> mujoco.MjModel:
    """MuJoCo's model of a URDF, as `urdf_spec` describes it.

    Raises:
        RobotError: As there.
    """
    return urdf_spec(name, urdf).compile()


def urdf_spec(name: str, urdf: str) -> mujoco.MjSpec:
    """What MuJoCo makes a model of, from a URDF as XML, without its meshes, whose files need not be there.

    Shapes of no size are left out, too.

    A link whose only shapes are meshes gets a box with the inertia of the link, if the URDF gives it one.

    Raises:
        RobotError: MuJoCo cannot make a model of it; `name` says of what.
    """
    root = ElementTree.fromstring(urdf)
    for settings in root.findall("mujoco"):
        root.remove(settings)
    ElementTree.SubElement(ElementTree.SubElement(root, "mujoco"), "compiler", _COMPILER)
    bare = []
    for link in root.findall("link"):
        shapes = []
        for shape in link.findall("visual") + link.findall("collision"):
            if _without_size(shape):
                link.remove(shape)
            else:
                shapes.append(shape)
        meshes = [shape for shape in shapes if shape.find("geometry/mesh") is not None]
        for mesh in meshes:
            link.remove(mesh)
        if meshes and len(meshes) == len(shapes) and link.find("inertial/mass") is not None:
            bare.append(link.get("name", ""))
    onward = _onward(root)
    try:
        for inertia in root.iterfind("link/inertial/inertia"):
            _make_possible(inertia)
        spec = mujoco.MjSpec.from_string(ElementTree.tostring(root, encoding="unicode"))
        model = spec.compile()
        for link_name in bare:
            _add_shape(spec.body(link_name), model.body(link_name), onward.get(link_name, np.zeros(3)))
        spec.compile()
        return spec
    except ValueError as error:
        raise RobotError(
            f"MuJoCo cannot make a model of the URDF of {name} ({' '.join(str(error).split())})"
        ) from error


def _without_size(shape: ElementTree.Element) -> bool:
    """Whether a visual or collision element is nothing to see, such as a sphere of radius 0."""
    sizes = [
        form.get(key, "") for form in shape.iterfind("geometry/*") for key in ("radius", "length", "size")
    ]
    return any(not size.strip("0.") for words in sizes for size in words.split())


def _onward(root: ElementTree.Element) -> dict[str, np.ndarray]:
    """Where in a link the next joint is, of links with only one that moves: (3,) by the link's name [m]."""
    found: dict[str, list[np.ndarray]] = {}
    for joint in root.findall("joint"):
        parent, origin = joint.find("parent"), joint.find("origin")
        if joint.get("type") != "fixed" and parent is not None:
            place = "0 0 0" if origin is None else origin.get("xyz", "0 0 0")
            found.setdefault(parent.get("link", ""), []).append(np.array(place.split(), float))
    return {link: places[0] for link, places in found.items() if len(places) == 1}


def _make_possible(inertia: ElementTree.Element) -> None:
    """Leave out products of inertia that no body can have; an exporter's error in a sign makes such."""
    (xx, xy, xz), (yy, yz, zz) = (
        [float(inertia.get(name, 0)) for name in row]
        for row in (("ixx", "ixy", "ixz"), ("iyy", "iyz", "izz"))
    )
    if np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])[0] < 0:
        inertia.attrib |= {"ixy": "0", "ixz": "0", "iyz": "0"}


def _add_shape(body: mujoco.MjsBody, compiled: Any, onward: np.ndarray) -> None:
    """A box of even density with the mass and inertia of a body, which `compiled` is a view of.

    A box that is longest across the way to the next joint, and too short along it, comes of an inertia with
    its axes mixed up (Pepper's forearms). A capsule from joint to joint, as thick as the box, stands for it.
    """
    mass, inertia = compiled.mass[0], compiled.inertia
    if mass <= float(_COMPILER["boundmass"]):
        return
    halves = np.sqrt(np.maximum(1.5 / mass * (inertia.sum() - 2 * inertia), _THINNEST**2))
    density = mass / (8 * halves.prod())
    halves *= min(1.0, np.cbrt(density / LIGHTEST))
    length = np.linalg.norm(onward)
    axes = np.zeros(9)
    mujoco.mju_quat2Mat(axes, compiled.iquat)
    along = np.abs(onward @ axes.reshape(3, 3)) * halves
    if halves.argmax() != along.argmax() and 2 * along.sum() < length**2 < 2 * halves.max() * length:
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            fromto=[0, 0, 0, *onward],
            size=[np.median(halves), 0, 0],
            rgba=_COLOR,
            contype=0,
            conaffinity=0,
            mass=0,
        )
        return
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=halves,
        pos=compiled.ipos,
        quat=compiled.iquat,
        rgba=_COLOR,
        contype=0,
        conaffinity=0,
        mass=0,
    )
