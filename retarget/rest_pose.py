"""How a robot rests: its arms hang down, and what speakers do is in reach from there."""

from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares

from gesture_bot.retarget.clearance import Clearance
from gesture_bot.retarget.kinematics import Kinematics
from gesture_bot.retarget.reach import BONES, HANGING, angle_between, both_arms, misses
from gesture_bot.retarget.robot import Robot
from gesture_bot.retarget.solver import DirectionSolver

SPREADS = (0.15, 0.3, 0.45, 0.6)
"""How far outward the arms hang, of a length of one; the first that keeps the robot off itself."""

KEPT = 0.01
"""Least distance of the arms from the rest of the robot in the rest pose [m]."""

_STARTS = 6
"""Random poses from which the rest pose is looked for, beside zero."""

_TO_ZERO = 0.05
"""Weight of the distance of the rest pose from zero [1/rad]."""

_REACH = 0.2
"""Weight of what the poses of `reach` miss beside what the rest pose misses."""

_BENT = 30.0
"""Weight of angles far from zero beside that [degrees^2/rad^2]."""


def rest_pose(robot: Robot) -> np.ndarray:
    """(j,) angles at which the arms hang, a little bent, off the body [rad].

    Only the arms' joints are moved; where they rest now does not matter. Often several ways lead there, with
    the elbow turned in or out. Each arm takes the one from which what speakers do is best in reach, and of
    which both keep clear of the robot.
    """
    arms = _arms(robot)
    start = np.where(arms[0] | arms[1], np.clip(0, robot.limits.lower, robot.limits.upper), robot.rest)
    robot = replace(robot, rest=start)
    solver, clearance = DirectionSolver(robot), Clearance(robot)
    ways = np.concatenate([_hanging(solver, robot, spread) for spread in SPREADS])
    off = np.array([angle_between(solver.reached(way)[BONES], both_arms(HANGING)) for way in ways])
    poses = np.array([list(misses(replace(robot, rest=way)).values()) for way in ways])
    missed = (off**2 + _REACH * np.sum(poses**2, axis=1)).reshape(-1, 2, 2).sum(axis=2)
    far = np.stack([np.sum(ways[:, arm] ** 2, axis=1) for arm in arms], axis=1)
    left, right = (missed + _BENT * far).T
    rests = []
    for one, other in sorted(
        np.ndindex(len(ways), len(ways)), key=lambda pair: left[pair[0]] + right[pair[1]]
    ):
        rest = np.select(arms, (ways[one], ways[other]), start)
        distance = clearance.nearest(rest).distance
        if distance >= KEPT:
            return rest
        rests.append((distance, rest))
    return max(rests, key=lambda pair: pair[0])[1]


def _arms(robot: Robot) -> list[np.ndarray]:
    """(j,) which joints move the left arm, and which the right."""
    kinematics, mapping = Kinematics(robot), robot.mapping
    inside, *arms = (
        kinematics.joints_above(kinematics.link(link))
        for link in (mapping.torso, mapping.left_arm.hand, mapping.right_arm.hand)
    )
    return [arm & ~inside for arm in arms]


def _hanging(solver: DirectionSolver, robot: Robot, spread: float) -> np.ndarray:
    """(n, j) ways for the arms to hang [rad]."""
    lower, upper = robot.limits.lower, robot.limits.upper
    (x, _, z), forearm = HANGING
    bones = both_arms(((x, spread, z), (forearm[0], spread, forearm[2])))
    margin = np.minimum(0.03, (upper - lower) / 20)
    bounds = lower + margin, upper - margin

    def residuals(angles: np.ndarray) -> np.ndarray:
        off = solver.reached(angles)[BONES] - bones
        return np.concatenate([off.ravel(), _TO_ZERO * (angles - robot.rest)])

    def derivatives(angles: np.ndarray) -> np.ndarray:
        jacobian = solver.linearise(angles)[1].reshape(-1, 3, len(angles))[BONES]
        return np.concatenate([jacobian.reshape(-1, len(angles)), _TO_ZERO * np.eye(len(angles))])

    random = np.random.default_rng(0)
    starts = [np.clip(robot.rest, *bounds), *random.uniform(*bounds, (_STARTS, len(lower)))]
    found = [
        least_squares(residuals, start, derivatives, bounds).x.round(2) + 0.0 for start in starts
    ]  # no -0.0
    return np.unique(np.clip(found, lower + 1e-4, upper - 1e-4), axis=0)
