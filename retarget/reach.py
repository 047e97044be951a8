"""Can a robot do what speakers do with their arms: a handful of poses, taken up from its rest pose."""

import numpy as np

from gesture_bot.retarget.robot import Robot
from gesture_bot.retarget.solver import DirectionSolver

Pose = tuple[tuple[float, float, float], tuple[float, float, float]]
"""Upper arm and forearm of a left arm, in the torso's frame, of any length; the right one mirrors."""

BONES = [0, 1, 3, 4]
"""Left upper arm, left forearm, right upper arm, right forearm among DIRECTIONS."""

HANGING: Pose = ((0.1, 0.15, -1.0), (0.45, 0.15, -0.9))
"""Arms at rest."""

POSES: dict[str, Pose] = {
    "hands before the chest": ((0.3, 0.25, -0.9), (0.85, -0.35, 0.35)),
    "hands on the belly": ((0.0, 0.3, -0.95), (0.6, -0.75, 0.1)),
    "arms forward": ((0.9, 0.1, -0.3), (1.0, 0.0, 0.0)),
    "arms wide": ((0.2, 0.75, -0.6), (0.6, 0.75, 0.2)),
    "hands up": ((0.3, 0.6, -0.7), (0.3, 0.2, 0.95)),
}
"""What speakers do."""

WAVE: tuple[Pose, Pose] = ((0.2, 0.8, -0.5), (0.3, 0.9, 0.8)), ((0.2, 0.8, -0.5), (0.3, 0.0, 0.9))
"""A hand that waves goes from one of these to the other."""

APART = 2.0
"""Hands so far from each other [arm lengths] are left to the directions."""

_LONGEST = 30
"""Frames after which a pose is taken for reached."""

_SETTLED = 0.005
"""It is, too, when a frame moves no joint by more [rad]."""


def both_arms(pose: Pose) -> np.ndarray:
    """(4, 3) unit vectors of BONES from those of a left arm."""
    left = np.array(pose) / np.linalg.norm(pose, axis=1, keepdims=True)
    return np.concatenate([left, left * [1, -1, 1]])


def misses(robot: Robot) -> dict[str, np.ndarray]:
    """How far off the robot's BONES stay in each of POSES when it moves there from its rest pose.

    Returns:
        (4,) angles by pose [degrees].
    """
    solver = DirectionSolver(robot)
    return {
        name: angle_between(solver.reached(taken_up(robot, solver, pose, robot.rest))[BONES], both_arms(pose))
        for name, pose in POSES.items()
    }


def taken_up(robot: Robot, solver: DirectionSolver, pose: Pose, start: np.ndarray) -> np.ndarray:
    """(j,) angles of the robot when it has moved from (j,) others into a pose of both arms [rad]."""
    targets = solver.reached(robot.rest)
    targets[BONES] = both_arms(pose)
    targets[-1] = [0.0, APART, 0.0]
    angles = start
    for _ in range(_LONGEST):
        before, angles = angles, solver.solve(targets, angles)
        if np.abs(angles - before).max() < _SETTLED:
            break
    return angles


def angle_between(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Angles between unit vectors: (..., 3), (..., 3) -> (...) [degrees]."""
    return np.degrees(np.arccos(np.clip(np.sum(one * other, axis=-1), -1, 1)))
