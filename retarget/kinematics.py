"""Forward kinematics of a robot: where its links are, which way they point, and what they look like."""

from collections.abc import Collection
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from gesture_bot.retarget.robot import Robot
from gesture_bot.retarget.urdf_model import mimics, urdf_model

_KINDS = {
    mujoco.mjtGeom.mjGEOM_BOX: "box",
    mujoco.mjtGeom.mjGEOM_SPHERE: "sphere",
    mujoco.mjtGeom.mjGEOM_CYLINDER: "cylinder",
    mujoco.mjtGeom.mjGEOM_CAPSULE: "capsule",
}

LOOKS = 1
"""MuJoCo's group of the shapes that a URDF has for looks alone."""

_NEXT, _LAST = [1, 2, 0], [2, 0, 1]
"""Indices of a cross product, which numpy.cross is slow at."""


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
    """A robot's links at given joint angles, in its base frame.

    Joints that mimic one of the robot's joints follow it; others without a servo stay at zero.

    Args:
        robot: Whose kinematics.

    Attributes:
        model: MuJoCo model.
        data: MuJoCo data at the angles of the last `place`.
        coupling: (nv, j) how far each of MuJoCo's joints moves with each of the robot's.

    Raises:
        RobotError: MuJoCo cannot make a model of the URDF.
    """

    def __init__(self, robot: Robot):
        self.model = urdf_model(robot.name, robot.urdf)
        self.data = mujoco.MjData(self.model)
        columns = {name: column for column, name in enumerate(robot.joints)}
        # The robot's own joints come first, in their order; each of them moves as it is told.
        moved = {name: np.eye(len(columns))[column] for name, column in columns.items()}
        offsets = dict.fromkeys(moved, 0.0)
        for name, mimic in mimics(robot.urdf).items():
            if mimic.joint in columns and name not in columns:
                moved[name] = mimic.multiplier * moved[mimic.joint]
                offsets[name] = mimic.offset
        self._joints = np.array([self.model.joint(name).id for name in moved])
        self._addresses = self.model.jnt_qposadr[self._joints]
        self._coupling, self._offsets = np.array(list(moved.values())), np.array(list(offsets.values()))
        self.coupling = np.zeros((self.model.nv, len(columns)))
        self.coupling[self.model.jnt_dofadr[self._joints]] = self._coupling
        self._turn = (self.model.jnt_type[self._joints] == mujoco.mjtJoint.mjJNT_HINGE).astype(float)[:, None]
        self._moves = np.array([self._moved_by(link) for link in range(self.model.nbody)], float)
        self.place(robot.rest)

    def place(self, angles: np.ndarray) -> None:
        """Put the joints at (j,) angles [rad]."""
        self.data.qpos[self._addresses] = self._coupling @ angles + self._offsets
        mujoco.mj_kinematics(self.model, self.data)

    def link(self, name: str) -> int:
        """Index of a link in MuJoCo's arrays of bodies."""
        return self.model.body(name).id

    def position(self, link: str, at: ArrayLike = (0.0, 0.0, 0.0)) -> np.ndarray:
        """(3,) where a point of a link is that lies (3,) in its frame, by default its origin [m]."""
        return self.data.xpos[self.link(link)] + self.rotation(link) @ at

    def rotation(self, link: str) -> np.ndarray:
        """(3, 3) rotation from a link's frame to the base frame."""
        return self.data.xmat[self.link(link)].reshape(3, 3).copy()

    def jacobians(self, links: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Derivatives of the position and the rotation of links, in the base frame.

        Args:
            links: (n,) indices.
            points: (n, 3) whose positions are meant; they move with the links [m].

        Returns:
            (n, 2, 3, j).
        """
        # As mj_jac does, for all links at once and the robot's joints alone.
        axes = self.data.xaxis[self._joints]
        turning, sliding = (self._turn * axes).T, ((1 - self._turn) * axes).T
        arms = points[:, :, None] - self.data.xanchor[self._joints].T
        out = np.empty((len(links), 2, *arms.shape[1:]))
        out[:, 0] = turning[_NEXT] * arms[:, _LAST] - turning[_LAST] * arms[:, _NEXT] + sliding
        out[:, 1] = turning
        out *= self._moves[links, None, None]
        own = self._coupling.shape[1]
        if own == len(self._joints):
            return out
        return out[..., :own] + out[..., own:] @ self._coupling[own:]

    def joints_above(self, link: int) -> np.ndarray:
        """(j,) which of the robot's joints move a link."""
        return (self._moves[link] @ np.abs(self._coupling)).astype(bool)

    def _moved_by(self, link: int) -> np.ndarray:
        """Which of the joints that move a link hangs on."""
        found = np.zeros(len(self._joints), bool)
        while link:
            found |= self.model.jnt_bodyid[self._joints] == link
            link = self.model.body_parentid[link]
        return found

    def segments(self) -> np.ndarray:
        """(n, 2, 3) lines from each link's parent to the link [m]."""
        children = np.arange(2, self.model.nbody)
        return np.stack(
            [self.data.xpos[self.model.body_parentid[children]], self.data.xpos[children]], axis=1
        )

    def shapes(self, meshed: Collection[str] = ()) -> list[Shape]:
        """The primitive shapes that the robot is drawn with.

        A link without shapes for looks shows those for collisions. Boxes stand for meshes.

        Args:
            meshed: Links whose meshes are drawn, too, so that nothing must stand for them.
        """
        looks = self.model.geom_contype == 0
        owners = self.model.geom_bodyid
        shown = looks | ~np.isin(owners, owners[looks])
        shown &= ~np.isin(owners, [self.link(name) for name in meshed]) | (self.model.geom_group == LOOKS)
        return [
            Shape(
                _KINDS[mujoco.mjtGeom(self.model.geom_type[geom])],
                self.model.geom_size[geom].copy(),
                self.data.geom_xpos[geom].copy(),
                self.data.geom_xmat[geom].reshape(3, 3).copy(),
                self.model.geom_rgba[geom].copy(),
            )
            for geom in np.flatnonzero(shown)
        ]


def arm_joints(robot: Robot) -> dict[str, tuple[str, ...]]:
    """The joints of the `left` and the `right` arm, from the shoulder on.

    Raises:
        RobotError: MuJoCo cannot make a model of the URDF.
    """
    kinematics = Kinematics(robot)
    inside = kinematics.joints_above(kinematics.link(robot.mapping.torso))
    places = [kinematics.model.joint(name).dofadr[0] for name in robot.joints]
    arms = {}
    for side, arm in (("left", robot.mapping.left_arm), ("right", robot.mapping.right_arm)):
        moving = kinematics.joints_above(kinematics.link(arm.hand)) & ~inside
        # MuJoCo numbers joints from the base out; a servo table may have any order.
        outward = sorted(np.flatnonzero(moving), key=lambda column: places[column])
        arms[side] = tuple(robot.joints[column] for column in outward)
    return arms
