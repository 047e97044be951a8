"""Keyframed gestures as motion: from their poses to frames of keypoints."""

from collections.abc import Iterable
from typing import TypeVar

import numpy as np
from scipy.spatial.transform import Rotation

from gesture_bot.base.keypoints import INDEX
from gesture_bot.base.vectors import length
from gesture_bot.corpus.movement import minimum_jerk
from gesture_bot.matching.arms import SIDES, Arm, Side, forearm, natural_elbow
from gesture_bot.matching.banks import ArmPose, Gesture, HeadPose, vector

Pose = TypeVar("Pose", ArmPose, HeadPose)

_HEAD = [INDEX["head"], INDEX["head_top"]]


def render(gesture: Gesture, times: np.ndarray, preparation: float, underlying: np.ndarray) -> np.ndarray:
    """The frames of a gesture, laid over a motion that it grows out of and goes back to.

    Between keyframes arms and head move by minimum jerk. An arm that the gesture does not use keeps the
    underlying motion.

    Args:
        gesture: The gesture.
        times: (n,) moments of the frames, from the stroke [s].
        preparation: Seconds from the underlying motion to the first keyframe.
        underlying: (n, 17, 3) the motion below it [m], pelvis frame.

    Returns:
        (n, 17, 3) [m], with the bone lengths of the underlying motion.
    """
    first, last = gesture.keyframes[0].time, gesture.keyframes[-1].time
    weight = minimum_jerk((times - first + preparation) / preparation)
    weight *= 1 - minimum_jerk((times - last) / gesture.retraction)
    segment, share = _between(np.array([keyframe.time for keyframe in gesture.keyframes]), times)

    out = underlying
    for side in SIDES:
        poses = _filled(keyframe.arm(side) for keyframe in gesture.keyframes)
        if poses[0] is not None:
            arms = _arms(poses, side, underlying[:1])
            target = _taken(arms, segment[0]).mixed(_taken(arms, segment[1]), share)
            out = Arm.of(underlying, side).mixed(target, weight).on(out, side)
    heads = _filled(keyframe.head for keyframe in gesture.keyframes)
    angles = np.array(
        [[-head.tilt, head.nod, head.turn] if head else [0, 0, 0] for head in heads], np.float64
    )
    angles = angles[segment[0]] + share[:, None] * (angles[segment[1]] - angles[segment[0]])
    return _with_head(out, weight[:, None] * angles)


def _between(
    keyframe_times: np.ndarray, times: np.ndarray
) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray]:
    """Keyframes before and after each moment (n,), and the share (n,) of the way from one to the other."""
    after = np.clip(np.searchsorted(keyframe_times, times), 1, max(len(keyframe_times) - 1, 1))
    before = after - 1
    after = np.minimum(after, len(keyframe_times) - 1)
    span = np.maximum(keyframe_times[after] - keyframe_times[before], 1e-9)
    return (before, after), minimum_jerk((times - keyframe_times[before]) / span)


def _filled(poses: Iterable[Pose | None]) -> list[Pose | None]:
    """Poses where each missing one is as the one before."""
    filled: list[Pose | None] = []
    for pose in poses:
        filled.append(pose if pose is not None or not filled else filled[-1])
    return filled


def _arms(poses: list[ArmPose | None], side: Side, body: np.ndarray) -> Arm:
    """The arm at each keyframe, on a body (1, 17, 3)."""
    shoulder, elbow, wrist = (body[:, INDEX[f"{side}_{joint}"]] for joint in ("shoulder", "elbow", "wrist"))
    upper, fore = length(elbow - shoulder), length(wrist - elbow)
    arms = []
    for pose in poses:
        assert pose is not None  # checked by the bank's schema
        place = np.array([[pose.wrist.forward, pose.wrist.out, pose.wrist.up]]) * (upper + fore)
        place[:, 1] *= 1 if side == "left" else -1
        bend = (vector(pose.elbow, side) if pose.elbow else natural_elbow(side))[None]
        along = vector(pose.fingers, side)[None] if pose.fingers else forearm(place, bend, upper, fore)
        arms.append(Arm(place, bend, along, vector(pose.palm, side)[None]))
    return Arm(
        np.concatenate([arm.wrist for arm in arms]),
        np.concatenate([arm.elbow for arm in arms]),
        np.concatenate([arm.fingers for arm in arms]),
        np.concatenate([arm.palm for arm in arms]),
    )


def _taken(arm: Arm, rows: np.ndarray) -> Arm:
    return Arm(arm.wrist[rows], arm.elbow[rows], arm.fingers[rows], arm.palm[rows])


def _with_head(keypoints: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Keypoints with the head turned about the neck by (n, 3) angles about x, y and z [degrees]."""
    out = keypoints.copy()
    neck = keypoints[:, INDEX["neck"]]
    turn = Rotation.from_euler("xyz", angles, degrees=True)
    for keypoint in _HEAD:
        out[:, keypoint] = neck + turn.apply(keypoints[:, keypoint] - neck)
    return out
