"""Forward kinematics of a robot: where its links are, which way they point, and what they look like."""

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass

import mujoco
import numpy as np

from gesture_bot.base.errors import RobotError
from gesture_bot.retarget.robot import Robot

# Fixed links stay links, shapes for looks are kept, and links without inertia are let through.
_COMPILER = {
    "fusestatic": "false",
    "discardvisual": "false",
    "balanceinertia": "true",
    "boundmass": "0.001",
    "boundinertia": "0.000001",
}
_KINDS = {
    mujoco.mjtGeom.mjGEOM_BOX: "box",
    mujoco.mjtGeom.mjGEOM_SPHERE: "sphere",
    mujoco.mjtGeom.mjGEOM_CYLINDER: "cylinder",
    mujoco.mjtGeom.mjGEOM_CAPSULE: "capsule",
}


@dataclass(frozen=True)
class Shape:
    """A primitive shape in the robot's base frame.

    Attributes:
        kind: box, sphere, cylinder or capsule; the last two lie along their z axis.
        size: (3,) half lengths of a box; else radius, half length along z, 0 [m].
        position: (3,) of its middle [m].
        rotation: (3, 3) from its frame to the base frame.
        rgba: (4,) colour, 0 to 1.
    """

    kind: str
    size: np.ndarray
    position: np.ndarray
    rotation: np.ndarray
    rgba: np.ndarray


class Kinematics:
    """A robot's links at given joint angles, in its base frame. Joints without a servo stay at zero.

    Args:
        robot: Whose kinematics.

    Attributes:
        model: MuJoCo model.
        data: MuJoCo data at the angles of the last `place`.
        columns: (j,) column of each of the robot's joints in MuJoCo's Jacobians.

    Raises:
        RobotError: MuJoCo cannot make a model of the URDF.
    """

    def __init__(self, robot: Robot):
        try:
            self.model = mujoco.MjModel.from_xml_string(_for_mujoco(robot.urdf))
        except ValueError as error:
            raise RobotError(
                f"the URDF of {robot.name} is no kinematic tree ({' '.join(str(error).split())})"
            ) from error
        self.data = mujoco.MjData(self.model)
        joints = [self.model.joint(name).id for name in robot.joints]
        self.columns = self.model.jnt_dofadr[joints]
        self._angles = self.model.jnt_qposadr[joints]
        self.place(robot.rest)

    def place(self, angles: np.ndarray) -> None:
        """Put the joints at (j,) angles [rad]."""
        self.data.qpos[self._angles] = angles
        mujoco.mj_kinematics(self.model, self.data)

    def link(self, name: str) -> int:
        """Index of a link in MuJoCo's arrays of bodies."""
        return self.model.body(name).id

    def position(self, link: str) -> np.ndarray:
        """(3,) origin of a link [m]."""
        return self.data.xpos[self.link(link)].copy()

    def rotation(self, link: str) -> np.ndarray:
        """(3, 3) rotation from a link's frame to the base frame."""
        return self.data.xmat[self.link(link)].reshape(3, 3).copy()

    def segments(self) -> np.ndarray:
        """(n, 2, 3) lines from each link's parent to the link [m]."""
        children = np.arange(2, self.model.nbody)
        return np.stack(
            [self.data.xpos[self.model.body_parentid[children]], self.data.xpos[children]], axis=1
        )

    def shapes(self) -> list[Shape]:
        """The primitive shapes that the robot is drawn with. Meshes are left out."""
        return [
            Shape(
                _KINDS[mujoco.mjtGeom(self.model.geom_type[geom])],
                self.model.geom_size[geom].copy(),
                self.data.geom_xpos[geom].copy(),
                self.data.geom_xmat[geom].reshape(3, 3).copy(),
                self.model.geom_rgba[geom].copy(),
            )
            for geom in np.flatnonzero(self.model.geom_contype == 0)
        ]


def _for_mujoco(urdf: str) -> str:
    """The URDF with our compiler settings, and without meshes, whose files need not be there."""
    root = ElementTree.fromstring(urdf)
    for settings in root.findall("mujoco"):
        root.remove(settings)
    ElementTree.SubElement(ElementTree.SubElement(root, "mujoco"), "compiler", _COMPILER)
    for link in root.findall("link"):
        for looks in link.findall("visual") + link.findall("collision"):
            if looks.find("geometry/mesh") is not None:
                link.remove(looks)
    return ElementTree.tostring(root, encoding="unicode")
