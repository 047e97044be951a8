"""A gesture of a bank as frames: it grows out of the motion below it and goes back to it."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from gesture_bot.base.keypoints import INDEX
from gesture_bot.base.vectors import length
from gesture_bot.corpus.movement import minimum_jerk
from gesture_bot.matching.arms import SIDES, Arm, Side, reach
from gesture_bot.matching.banks import Motion

HOME = np.array([0.45, 0.0, -0.35])
"""Where the hands of somebody who talks are at home, from each shoulder [arm lengths forward, out, up]."""

FARTHEST = 0.95
"""An amplitude stretches no arm beyond this share of its length."""


def render(
    motion: Motion, times: np.ndarray, preparation: float, underlying: np.ndarray, amplitude: float = 1.0
) -> np.ndarray:
    """The frames of a gesture, laid over a motion.

    An arm that the gesture does not use keeps the underlying motion.

    Args:
        motion: The gesture.
        times: (n,) moments of the frames, from the stroke [s].
        preparation: Seconds from the underlying motion to the gesture's first keyframe.
        underlying: (n, 17, 3) the motion below it [m], pelvis frame.
        amplitude: How far the wrists go from HOME, and the head turns; 1 is as in the bank.

    Returns:
        (n, 17, 3) [m], with the bone lengths of the underlying motion.
    """
    movement = motion.movement
    weight = minimum_jerk((times - movement.first + preparation) / preparation)
    weight *= 1 - minimum_jerk((times - movement.last) / motion.retraction)
    out = underlying
    for side in SIDES:
        target = movement.arm(side, times, underlying[0])
        if target is not None:
            target = _amplified(target, side, underlying[0], amplitude)
            out = Arm.of(underlying, side).mixed(target, weight).on(out, side)
    return _with_head(out, amplitude * weight[:, None] * movement.head(times))


def _amplified(arm: Arm, side: Side, body: np.ndarray, amplitude: float) -> Arm:
    """One arm of a body (17, 3) with its wrist nearer to HOME or farther away.

    An amplitude above 1 brings no hand nearer to the trunk or to the other hand.
    """
    scale = reach(body, side) * np.array([1, 1 if side == "left" else -1, 1])
    place = arm.wrist / scale
    moved = HOME + amplitude * (place - HOME)
    if amplitude > 1:
        moved[:, :2] = np.maximum(moved[:, :2], place[:, :2])
    moved *= np.minimum(1, np.maximum(length(place), FARTHEST) / length(moved))
    return replace(arm, wrist=scale * moved)


def _with_head(keypoints: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Keypoints with the head turned about the neck by (n, 3) angles about x, y and z [degrees]."""
    out = keypoints.copy()
    neck = keypoints[:, INDEX["neck"]]
    turn = Rotation.from_euler("xyz", angles, degrees=True)
    for name in ("head", "head_top"):
        out[:, INDEX[name]] = neck + turn.apply(keypoints[:, INDEX[name]] - neck)
    return out
