"""How far a robot's arms are from the rest of it, by its simple shapes and the boxes for its meshes."""

from dataclasses import dataclass

import mujoco
import numpy as np

from gesture_bot.retarget.kinematics import Kinematics
from gesture_bot.retarget.robot import Robot

FARTHEST = 0.5
"""Distances over this are not told apart [m]."""


@dataclass(frozen=True)
class Nearest:
    """Two links and the distance between them [m], negative if they are inside each other."""

    distance: float
    links: tuple[str, str]


class Clearance:
    """Distances of both forearms and hands from everything that is not in their arm.

    The upper arm is left out, since it lies against the torso by design. A shape that the URDF gives for
    collisions counts before one for looks.

    Args:
        robot: Whose distances.
    """

    def __init__(self, robot: Robot):
        self._kinematics = Kinematics(robot)
        model = self._kinematics.model
        solid = model.geom_contype != 0
        owners = model.geom_bodyid
        geoms = np.flatnonzero(solid | ~np.isin(owners, owners[solid]))
        arms = (robot.mapping.left_arm, robot.mapping.right_arm)
        forearms = [self._below(arm.elbow) for arm in arms]
        whole = [self._below(self._first(robot, arm.shoulder)) for arm in arms]
        self._pairs = [
            (int(one), int(other))
            for own, arm in zip(forearms, whole, strict=True)
            for one in geoms
            for other in geoms
            if owners[one] in own
            and owners[other] not in arm
            # The pair of both forearms is asked for once.
            and (owners[other] not in forearms[0] or own is not forearms[1])
        ]

    def nearest(self, angles: np.ndarray) -> Nearest:
        """The two links that are nearest to each other at (j,) angles [rad]."""
        self._kinematics.place(angles)
        model, data = self._kinematics.model, self._kinematics.data
        nearest = FARTHEST, ("", "")
        for one, other in self._pairs:
            distance = mujoco.mj_geomDistance(model, data, one, other, nearest[0], None)
            if distance < nearest[0]:
                names = (model.body(model.geom_bodyid[geom]).name for geom in (one, other))
                nearest = distance, (next(names), next(names))
        return Nearest(*nearest)

    def _below(self, link: str) -> set[int]:
        """A link and all that hang on it."""
        model, found = self._kinematics.model, {self._kinematics.link(link)}
        for body in range(model.nbody):
            if model.body_parentid[body] in found:
                found.add(body)
        return found

    def _first(self, robot: Robot, shoulder: str) -> str:
        """The link of the arm that is joined to the torso."""
        model, body = self._kinematics.model, self._kinematics.link(shoulder)
        torso = self._kinematics.link(robot.mapping.torso)
        while body and model.body_parentid[body] != torso:
            body = model.body_parentid[body]
        return model.body(body).name if body else shoulder
