"""Silence: a body that comes to rest close to where it is, and breathes (RG22)."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.cluster.vq import kmeans2

from gesture_bot.base.frames import FRAME_RATE
from gesture_bot.base.keypoints import INDEX, bone_lengths, mirror, with_bone_lengths
from gesture_bot.base.vectors import length
from gesture_bot.corpus.database import SEQUENCE, Database
from gesture_bot.matching.quantities import wrist_height, wrist_speed
from gesture_bot.matching.search import ranks_of

HALF_LIFE = 0.32
"""After so long, about half of the way to rest is left [s]."""

BREATH = 3.8
"""Seconds from one breath to the next."""

POSES = 8
"""Poses at rest that a database gives at most."""

LOOKED_AT = 2000
"""Sequences that stand for a database."""

_BREATHING = np.zeros((len(INDEX), 3))  # how far a breath moves each keypoint [m]
_BREATHING[INDEX["left_elbow"]] = 0.0, 0.006, 0.003
_BREATHING[[INDEX[f"left_{part}"] for part in ("wrist", "index", "little")]] = 0.006, 0.003, 0.008
_BREATHING += mirror(_BREATHING)


def rest_pose(database: Database) -> np.ndarray:
    """(17, 3) float64 [m]: the mean of the database's calmest frames, with the bones of its body."""
    calmest = _calmest(database)
    return with_bone_lengths(calmest.mean(axis=0), np.median(bone_lengths(calmest), axis=0))


def rest_poses(database: Database) -> np.ndarray:
    """(n, 17, 3) float64 [m], up to POSES: the means of clusters of these frames, with those bones."""
    calmest = _calmest(database)
    frames = calmest.reshape(len(calmest), -1)
    centres, cluster = kmeans2(frames, min(POSES, len(np.unique(frames, axis=0))), minit="++", seed=0)
    poses = centres[np.unique(cluster)].reshape(-1, *calmest.shape[1:])
    return with_bone_lengths(poses, np.median(bone_lengths(calmest), axis=0))


def nearest(poses: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """Of some poses (n, 17, 3), the one whose keypoints are nearest to those of a pose (17, 3)."""
    return poses[length(poses - pose).mean(axis=1).argmin()]


def _calmest(database: Database) -> np.ndarray:
    """(n, 17, 3) float64 [m]: the tenth of all frames at which both wrists are lowest and slowest.

    Of neutral frames alone, where the database has any. Of a long database, LOOKED_AT sequences count.
    """
    starts = database.starts
    if "neutral" in database.names["emotion"]:
        starts = starts[database.labelled("emotion", "neutral")]
    starts = starts[:: math.ceil(len(starts) / LOOKED_AT)]
    keypoints = database.keypoints[(starts[:, None] + np.arange(SEQUENCE)).ravel()].astype(np.float64)
    speed = wrist_speed(keypoints, np.arange(len(starts)).repeat(SEQUENCE))
    unrest = ranks_of(wrist_height(keypoints).max(axis=1)) + ranks_of(speed.max(axis=1))
    return keypoints[np.argsort(unrest, kind="stable")[: len(keypoints) // 10]]


@dataclass(frozen=True)
class Settling:
    """A body on its way to rest, like a critically damped spring, from a pose and a velocity.

    Attributes:
        start: Frame of the grid whose pose is `pose`.
        pose: (17, 3) [m].
        velocity: (17, 3) [m/s].
        rest: (17, 3) the pose to come to [m].
    """

    start: int
    pose: np.ndarray
    velocity: np.ndarray
    rest: np.ndarray

    def at(self, frames: np.ndarray) -> np.ndarray:
        """(n,) frames of the grid, none before `start` -> (n, 17, 3) [m], with the bone lengths of `pose`."""
        t = ((frames - self.start) / FRAME_RATE)[:, None, None]
        damping = 2 * np.log(2) / HALF_LIFE
        offset = self.pose - self.rest
        offset_velocity = self.velocity - 2 * np.pi / BREATH * _BREATHING
        springs = np.exp(-damping * t) * (offset + (offset_velocity + damping * offset) * t)
        goal = self.rest + _BREATHING * np.sin(2 * np.pi * t / BREATH)
        return with_bone_lengths(goal + springs, bone_lengths(self.pose))
