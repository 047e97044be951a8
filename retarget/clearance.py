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
        kinematics: What moves the robot; its own if None.
    """

    def __init__(self, robot: Robot, kinematics: Kinematics | None = None):
        self._kinematics = kinematics or Kinematics(robot)
        model = self._kinematics.model
        solid = model.geom_contype != 0
        owners = model.geom_bodyid
        geoms = np.flatnonzero(solid | ~np.isin(owners, owners[solid]))
        arms = (robot.mapping.left_arm, robot.mapping.right_arm)
        forearms = [self._below(arm.elbow) for arm in arms]
        whole = [self._below(self._first(robot, arm.shoulder)) for arm in arms]
        pairs = [
            (int(one), int(other))
            for own, arm in zip(forearms, whole, strict=True)
            for one in geoms
            for other in geoms
            if owners[one] in own
            and owners[other] not in arm
            # The pair of both forearms is asked for once.
            and (owners[other] not in forearms[0] or own is not forearms[1])
        ]
        self._pairs = np.array(pairs, int).reshape(-1, 2)
        self._every = np.arange(len(self._pairs))
        self._radii = model.geom_rbound[self._pairs].sum(axis=1)
        self._ends = np.zeros(6)

    def nearest(self, angles: np.ndarray) -> Nearest:
        """The two links that are nearest to each other at (j,) angles [rad]."""
        self._kinematics.place(angles)
        model = self._kinematics.model
        nearest = FARTHEST, ("", "")
        for pair in self._around(FARTHEST):
            if (distance := self.distance(pair, nearest[0])) < nearest[0]:
                one, other = (model.body(model.geom_bodyid[geom]).name for geom in self._pairs[pair])
                nearest = distance, (one, other)
        return Nearest(*nearest)

    def under(self, angles: np.ndarray, limit: float) -> dict[int, float]:
        """Distances under a limit at (j,) angles, by the number of the pair of shapes [rad, m]."""
        self._kinematics.place(angles)
        found = {pair: self.distance(pair, limit) for pair in self._around(limit)}
        return {pair: distance for pair, distance in found.items() if distance < limit}

    def rows(self, limit: float) -> tuple[np.ndarray, np.ndarray]:
        """(n,) distances under a limit where the joints are now [m], and their (n, j) derivatives [m/rad]."""
        found: list[float] = []
        pairs, ends = [], []
        for pair in self._around(limit):
            distance = self.distance(pair, limit)
            if distance < limit and distance:
                found.append(distance)
                pairs.append(pair)
                ends.append(self._ends.copy())
        if not found:
            return np.empty(0), np.empty((0, self._kinematics.coupling.shape[1]))
        distances, points = np.array(found), np.array(ends).reshape(-1, 2, 3)
        links = self._kinematics.model.geom_bodyid[self._pairs[pairs]]
        moving = self._kinematics.jacobians(links.ravel(), points.reshape(-1, 3))[:, 0]
        moving = moving.reshape(-1, 2, *moving.shape[1:])
        away = (points[:, 1] - points[:, 0]) / distances[:, None]
        return distances, (away[:, None] @ (moving[:, 1] - moving[:, 0]))[:, 0]

    def joints(self, pair: int) -> np.ndarray:
        """(j,) which joints move the shapes of a pair against each other."""
        return np.any(self.sides(pair), axis=0)

    def sides(self, pair: int) -> list[np.ndarray]:
        """(j,) masks of the joints that move one shape of a pair and not the other; one mask, or two."""
        one, other = self._kinematics.model.geom_bodyid[self._pairs[pair]]
        above, beside = self._kinematics.joints_above(one), self._kinematics.joints_above(other)
        return [side for side in (above & ~beside, beside & ~above) if side.any()]

    def reaches(self) -> np.ndarray:
        """(pairs, j) how far the shapes of each pair move against each other at most, by joint [m/rad]."""
        geoms = np.unique(self._pairs)
        reaches = np.zeros((self._kinematics.model.ngeom, self._kinematics.coupling.shape[1]))
        reaches[geoms] = [self._reach(geom) for geom in geoms]
        one, other = reaches[self._pairs[:, 0]], reaches[self._pairs[:, 1]]
        # A joint that moves both shapes leaves them as they are to each other.
        return np.where((one > 0) & (other > 0), 0.0, one + other)

    def gaps(self, pairs: np.ndarray) -> np.ndarray:
        """(n,) distances of the spheres around the shapes of n pairs, where the joints are now [m]."""
        centres, (one, other) = self._kinematics.data.geom_xpos, self._pairs[pairs].T
        apart = centres.take(one, axis=0) - centres.take(other, axis=0)
        return np.sqrt(np.einsum("ij,ij->i", apart, apart)) - self._radii[pairs]

    def place(self, angles: np.ndarray) -> None:
        """Put the joints at (j,) angles [rad]."""
        self._kinematics.place(angles)

    def distance(self, pair: int, limit: float) -> float:
        """Between the shapes of a pair, where the joints are now [m]; the limit, if that is less."""
        one, other = self._pairs[pair]
        return float(
            mujoco.mj_geomDistance(
                self._kinematics.model, self._kinematics.data, one, other, limit, self._ends
            )
        )

    def _reach(self, geom: int) -> np.ndarray:
        """(j,) how far any point of a shape can be from the axis of each joint that moves it [m]."""
        model, coupling = self._kinematics.model, self._kinematics.coupling
        reach = np.zeros(coupling.shape[1])
        length = np.linalg.norm(model.geom_pos[geom]) + model.geom_rbound[geom]
        body = model.geom_bodyid[geom]
        while body:
            dofs = model.dof_bodyid == body
            away = length + np.linalg.norm(model.jnt_pos[model.dof_jntid[dofs]], axis=1)
            reach = np.maximum(reach, (np.abs(coupling[dofs]) * away[:, None]).max(axis=0, initial=0.0))
            length += np.linalg.norm(model.body_pos[body])
            body = model.body_parentid[body]
        return reach

    def _around(self, limit: float) -> np.ndarray:
        """Pairs whose bounding spheres are closer than a limit."""
        return np.flatnonzero(self.gaps(self._every) < limit)

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
