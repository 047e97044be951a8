"""Where each link of a robot is in the frame of the link that it hangs on, as tf tells it."""

import xml.etree.ElementTree as ElementTree
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from gesture_bot.retarget.kinematics import Kinematics
from gesture_bot.retarget.robot import Robot


class LinkFrame(NamedTuple):
    """A link in the frame of its parent: (3,) position [m] and (4,) quaternion x, y, z, w."""

    parent: str
    link: str
    position: np.ndarray
    rotation: np.ndarray


class LinkFrames:
    """All links of a robot.

    Args:
        robot: Whose links.

    Attributes:
        base: The link that hangs on no other.

    Raises:
        RobotError: MuJoCo cannot make a model of the URDF.
    """

    def __init__(self, robot: Robot):
        self._kinematics = Kinematics(robot)
        model = self._kinematics.model
        root = ElementTree.fromstring(robot.urdf)
        children = {child.get("link") for child in root.iterfind("joint/child")}
        self.base = next(
            name for link in root.iterfind("link") if (name := link.get("name", "")) not in children
        )
        # MuJoCo may take the base for its world, which has another name.
        self._names = [model.body(body).name for body in range(model.nbody)]
        if self.base not in self._names:
            self._names[0] = self.base
        self._first = self._names.index(self.base) + 1
        # Links that move with a joint of their own; the others are fixed to their parents.
        self._moving = model.body_jntnum[self._first :] > 0

    def fixed(self) -> list[LinkFrame]:
        """Links that never move in the frames of their parents."""
        return self._frames(~self._moving)

    def moving(self, angles: np.ndarray) -> list[LinkFrame]:
        """Links with joints, at (j,) joint angles [rad]."""
        self._kinematics.place(angles)
        return self._frames(self._moving)

    def _frames(self, which: np.ndarray) -> list[LinkFrame]:
        data, links = self._kinematics.data, np.flatnonzero(which) + self._first
        if not len(links):
            return []
        parents = self._kinematics.model.body_parentid[links]
        turns = Rotation.from_matrix(data.xmat.reshape(-1, 3, 3))
        back = turns[parents].inv()
        positions = back.apply(data.xpos[links] - data.xpos[parents])
        rotations = (back * turns[links]).as_quat()
        return [
            LinkFrame(self._names[parent], self._names[link], position, rotation)
            for parent, link, position, rotation in zip(parents, links, positions, rotations, strict=True)
        ]
