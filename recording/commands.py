"""What the joints were told, as one motion."""

from collections.abc import Iterable
from itertools import pairwise

import numpy as np

from gesture_bot.base.trajectory import JointTrajectory

_APART = 0.01
"""Points of two commands that are nearer to each other are one [s]."""


def commanded_motion(commands: Iterable[JointTrajectory]) -> JointTrajectory:
    """Each command until the next one begins, and the last one to its end.

    Args:
        commands: In the order in which they were given, of the same joints; each replaces the one before from
            its first point on. One that does not begin after the one before is left out.
    """
    kept: list[JointTrajectory] = []
    for command in commands:
        if not kept or (command.joints == kept[0].joints and command.times[0] > kept[-1].times[0] + _APART):
            kept.append(command)
    parts = []
    for command, following in pairwise(kept):
        first = command.times < following.times[0] - _APART
        first[0] = True
        parts.append((command.times[first], command.positions[first], command.velocities[first]))
    last = kept[-1]
    parts.append((last.times, last.positions, last.velocities))
    times, positions, velocities = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    return JointTrajectory(last.joints, times, positions, velocities)
