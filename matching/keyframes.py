"""Gestures as keyframes: poses that are reached and held at a time, and the movement between them."""

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import TypeVar

import numpy as np
from pydantic import Field

from gesture_bot.base.keypoints import INDEX
from gesture_bot.base.vectors import length
from gesture_bot.corpus.movement import minimum_jerk
from gesture_bot.matching.arms import SIDES, Arm, Side, forearm, natural_elbow
from gesture_bot.matching.poses import ArmPose, HeadPose, NamedArmPose, Strict, vector

SINKING = 0.05
"""Nobody holds a hand quite still: a held wrist sinks by so many arm lengths a second."""

Pose = TypeVar("Pose", ArmPose, HeadPose)


class Keyframe(Strict):
    """A pose reached and left at rest.

    An arm or the head that is not named stays as in the keyframe before. `both` is `left` and `right` at
    once, mirrored.

    Attributes:
        time: When the pose is reached, from the stroke [s].
        hold: How long it is held then [s].
        left, right, both: Poses of the arms.
        head: How the head is turned.
    """

    time: float = Field(ge=-5, le=15)
    hold: float = Field(0.0, ge=0, le=5)
    left: NamedArmPose | None = None
    right: NamedArmPose | None = None
    both: NamedArmPose | None = None
    head: HeadPose | None = None

    def arm(self, side: Side) -> ArmPose | None:
        """The pose of one arm, if this keyframe names it."""
        return (self.left if side == "left" else self.right) or self.both


def checked(keyframes: list[Keyframe]) -> list[Keyframe]:
    """Keyframes that make a gesture.

    Raises:
        ValueError: They do not; says why.
    """
    for before, after in pairwise(keyframes):
        if after.time <= before.time + before.hold:
            raise ValueError(
                f"the keyframe at {after.time} s must come after the one at {before.time} s, "
                f"which is held for {before.hold} s"
            )
    if not keyframes[0].time <= 0 <= keyframes[-1].time + keyframes[-1].hold:
        raise ValueError("the stroke, time 0, must lie within the keyframes")
    for side in SIDES:
        named = [keyframe.arm(side) is not None for keyframe in keyframes]
        if any(named) and not named[0]:
            raise ValueError(f"the first keyframe must pose the {side} arm, because a later one does")
    if any(keyframe.both and (keyframe.left or keyframe.right) for keyframe in keyframes):
        raise ValueError("a keyframe poses `both` arms or `left` and `right`, not all of them")
    return keyframes


class Keyframes:
    """The movement of keyframes: from each to the next by minimum jerk.

    Attributes:
        moments: (n,) when the keyframes are reached, from the stroke [s].
        first, last: When the first keyframe is reached and the last one left [s].
    """

    def __init__(self, keyframes: Sequence[Keyframe]) -> None:
        self._keyframes = keyframes
        self._times = np.array([(frame.time, frame.time + frame.hold) for frame in keyframes]).ravel()
        self.moments = self._times[::2]
        self.first, self.last = float(self._times[0]), float(self._times[-1])

    def arm(self, side: Side, times: np.ndarray, body: np.ndarray) -> Arm | None:
        """One arm of a body (17, 3) at (n,) moments from the stroke [s]; None where it has no part."""
        poses = _filled(frame.arm(side) for frame in self._keyframes)
        sinking = [SINKING * frame.hold for frame in self._keyframes]
        arms = [
            _posed(pose, side, sunk, body)
            for pose, held in zip(poses, sinking, strict=True)
            if pose
            for sunk in (0.0, held)
        ]
        if not arms:
            return None
        knots = Arm.stacked(arms)
        before, after, share = self._between(times)
        return knots.at(before).mixed(knots.at(after), share)

    def head(self, times: np.ndarray) -> np.ndarray:
        """(n, 3) how far the head is turned about x, y and z at (n,) moments from the stroke [degrees]."""
        poses = _filled(frame.head for frame in self._keyframes)
        turns = [(-pose.tilt, pose.nod, pose.turn) if pose else (0.0, 0.0, 0.0) for pose in poses]
        angles = np.repeat(turns, 2, axis=0)
        before, after, share = self._between(times)
        return angles[before] + share[:, None] * (angles[after] - angles[before])

    def _between(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Indices of the poses before and after each moment, (n,), and the share of the way done."""
        after = np.clip(np.searchsorted(self._times, times, side="right"), 1, len(self._times) - 1)
        span = np.maximum(self._times[after] - self._times[after - 1], 1e-9)
        return after - 1, after, minimum_jerk((times - self._times[after - 1]) / span)


def _filled(poses: Iterable[Pose | None]) -> list[Pose | None]:
    """Poses where each missing one is as the one before."""
    filled: list[Pose | None] = []
    for pose in poses:
        filled.append(pose if pose is not None or not filled else filled[-1])
    return filled


def _posed(pose: ArmPose, side: Side, sunk: float, body: np.ndarray) -> Arm:
    """One arm of a body (17, 3) in a pose, `sunk` arm lengths lower: vectors (3,)."""
    shoulder, elbow, wrist = (body[INDEX[f"{side}_{joint}"]] for joint in ("shoulder", "elbow", "wrist"))
    upper, fore = length(elbow - shoulder), length(wrist - elbow)
    outward = pose.wrist.out if side == "left" else -pose.wrist.out
    place = np.array([pose.wrist.forward, outward, pose.wrist.up - sunk]) * (upper + fore)
    bend = vector(pose.elbow, side) if pose.elbow else natural_elbow(side)
    along = vector(pose.fingers, side) if pose.fingers else forearm(place, bend, upper, fore)
    return Arm(place, bend, along, vector(pose.palm, side))
