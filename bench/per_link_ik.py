"""The rival of bench/retarget.py: each link of an arm put where it belongs by ikpy, from the shoulder out."""

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from ikpy.chain import Chain
from ikpy.link import OriginLink, URDFLink

from gesture_bot.retarget.description import Arm
from gesture_bot.retarget.kinematics import Kinematics, arm_joints
from gesture_bot.retarget.robot import Robot

STILL = 0.1
"""A joint that moves the elbow by less than this share of the upper arm's length turns the forearm."""

TOLERANCE = 1e-4
"""Where ikpy's optimizer ends; with its default a pose takes over 0.4 s."""


@dataclass(frozen=True)
class _Stage:
    """A chain from the torso to an arm's elbow or wrist, of which some joints are free.

    Attributes:
        chain: With the torso's link as its base.
        columns: (n,) which of the robot's joints each of its links is, -1 where none.
        row: The bone's row in DIRECTIONS.
        start: Link from which the bone points.
        length: Of the bone [m].
    """

    chain: Chain
    columns: np.ndarray
    row: int
    start: str
    length: float


class PerLinkIK:
    """Solves frame by frame as DirectionSolver does, but for the bones alone.

    The elbow is put where the person's upper arm points, by the joints that move it; then the wrist where the
    forearm points, by those up to it that do not. Both stay inside the limits and start from the frame
    before.

    Args:
        robot: For whom.
    """

    def __init__(self, robot: Robot):
        self._robot, self._kinematics = robot, Kinematics(robot)
        sides = zip(("left", "right"), (robot.mapping.left_arm, robot.mapping.right_arm), (0, 3), strict=True)
        self._stages = [stage for side, arm, row in sides for stage in self._arm(side, arm, row)]

    def solve(self, targets: np.ndarray, previous: np.ndarray) -> np.ndarray:
        """(j,) angles for (8, 3) directions in the torso's frame, from those of the frame before [rad]."""
        angles, mapping = previous.copy(), self._robot.mapping
        for stage in self._stages:
            self._kinematics.place(angles)
            into_torso = self._kinematics.rotation(mapping.torso).T
            start = self._kinematics.position(stage.start) - self._kinematics.position(mapping.torso)
            direction = mapping.torso_axes() @ targets[stage.row]
            own = stage.columns >= 0
            before = np.where(own, angles[stage.columns], 0.0)
            found = stage.chain.inverse_kinematics(
                into_torso @ start + stage.length * direction, initial_position=before, tol=TOLERANCE
            )
            angles[stage.columns[own]] = found[own]
        return angles

    def _arm(self, side: str, arm: Arm, row: int) -> Sequence[_Stage]:
        kinematics, joints = self._kinematics, self._robot.joints
        kinematics.place(self._robot.rest)
        points = [kinematics.position(arm.shoulder), kinematics.position(arm.elbow)]
        points.append(kinematics.position(arm.wrist, arm.wrist_at))
        upper, fore = np.linalg.norm(np.diff(points, axis=0), axis=1)
        elbow = kinematics.jacobians(np.array([kinematics.link(arm.elbow)]), points[1][None])[0, 0]
        moving = np.linalg.norm(elbow, axis=0) > STILL * upper
        own = np.isin(joints, arm_joints(self._robot)[side])
        return (
            self._stage(arm.elbow, (0.0, 0.0, 0.0), own & moving, row, arm.shoulder, upper),
            self._stage(arm.wrist, arm.wrist_at, own & ~moving, row + 1, arm.elbow, fore),
        )

    def _stage(
        self, end: str, at: Sequence[float], free: np.ndarray, row: int, start: str, length: float
    ) -> _Stage:
        robot = self._robot
        path, link = [], end
        by_child = {
            joint.find("child").get("link"): joint
            for joint in ElementTree.fromstring(robot.urdf).findall("joint")
        }
        while link != robot.mapping.torso:
            path.insert(0, by_child[link])
            link = by_child[link].find("parent").get("link")
        links, columns, active = [OriginLink()], [-1], [False]
        for joint in path:
            name, origin = joint.get("name"), joint.find("origin")
            column = robot.joints.index(name) if name in robot.joints else -1
            given = {} if origin is None else origin.attrib
            turns = column >= 0
            links.append(
                URDFLink(
                    name,
                    _numbers(given.get("xyz", "0 0 0")),
                    _numbers(given.get("rpy", "0 0 0")),
                    rotation=_numbers(joint.find("axis").get("xyz")) if turns else None,
                    bounds=(robot.limits.lower[column], robot.limits.upper[column]) if turns else None,
                    use_symbolic_matrix=False,
                    joint_type="revolute" if turns else "fixed",
                )
            )
            columns.append(column)
            active.append(turns and bool(free[column]))
        links.append(
            URDFLink("tip", np.array(at), np.zeros(3), use_symbolic_matrix=False, joint_type="fixed")
        )
        chain = Chain(links, active_links_mask=[*active, False])
        return _Stage(chain, np.array([*columns, -1]), row, start, float(length))


def _numbers(text: str) -> np.ndarray:
    return np.array(text.split(), float)
