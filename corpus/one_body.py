"""Every speaker in one body: the standard adult, its pelvis at the origin, facing forward."""

import numpy as np

from gesture_bot.base.keypoints import INDEX, KEYPOINTS, PARENTS, bone_lengths
from gesture_bot.base.vectors import across, unit
from gesture_bot.corpus.body import FOREARM, INDEX_ROOT, LITTLE_ROOT, UPPER_ARM, Posture, pose

_HANDS = np.array([[0.2, 0.15, 0.1, 0.0, 0.0]])
_STILL = np.zeros((1, 3))

STANDARD = pose(Posture(_HANDS, _HANDS, torso=_STILL, head=_STILL, elbows=0.2))[0]
"""(17, 3) keypoints of the standard body, upright [m]."""

STANDARD_LENGTHS = bone_lengths(STANDARD)
"""(16,) length of each of keypoints.BONES [m]."""

ARMS = tuple(
    [INDEX[f"{side}_{part}"] for part in ("shoulder", "elbow", "wrist")] for side in ("left", "right")
)
"""Shoulder, elbow and wrist of each arm, by index."""


def arm_bones(keypoints: np.ndarray) -> np.ndarray:
    """Lengths of both upper arms and forearms: (..., 17, 3) -> (..., 2 sides, 2 bones)."""
    arms = np.stack([keypoints[..., arm, :] for arm in ARMS], axis=-3)
    return np.linalg.norm(np.diff(arms, axis=-2), axis=-1)


def in_standard_size(keypoints: np.ndarray) -> np.ndarray:
    """Keypoints (n, 17, 3) of any unit, scaled so that the median arm is the standard body's [m]."""
    arm = np.nanmedian(arm_bones(keypoints).sum(axis=-1))
    return keypoints * (UPPER_ARM + FOREARM) / arm


def is_upright(keypoints: np.ndarray) -> bool:
    """Whether the neck is mostly over the pelvis in keypoints (n, 17, 3), z up; true without a pelvis."""
    rise = unit(keypoints[:, INDEX["neck"]] - keypoints[:, INDEX["pelvis"]])[:, 2]
    known = rise[np.isfinite(rise)]
    return len(known) == 0 or bool(np.median(known) > 0.5)


def in_pelvis_frame(keypoints: np.ndarray) -> np.ndarray:
    """Move the pelvis to the origin, take the heading out, and fill in what the source lacks.

    The heading is that of the hips or, without them, of the shoulders. Leaning stays.

    Args:
        keypoints: (n, 17, 3) positions [m], z up; a keypoint that is NaN throughout is one that the source
            lacks, and NaN in some frames is lost there.

    Returns:
        (n, 17, 3) positions [m], x forward, y left, z up. Where something is lost, all that is placed by it
        is NaN too.
    """
    lacking = {name for name in KEYPOINTS if np.isnan(keypoints[:, INDEX[name]]).all()}
    pelvis = keypoints[:, INDEX["pelvis"]]
    if "pelvis" in lacking:
        pelvis = keypoints[:, INDEX["neck"]] - STANDARD[INDEX["neck"]]
    pair = "shoulder" if {"left_hip", "right_hip"} & lacking else "hip"
    left = keypoints[:, INDEX[f"left_{pair}"]] - keypoints[:, INDEX[f"right_{pair}"]]
    out = np.einsum("nij,nkj->nki", _facing(left), keypoints - pelvis[:, None])
    out[:, INDEX["pelvis"]] = np.where(np.isnan(pelvis), np.nan, 0.0)
    for name in KEYPOINTS:
        if name in lacking - {"pelvis"}:
            out[:, INDEX[name]] = _placed(name, out)
    return out


def _facing(left: np.ndarray) -> np.ndarray:
    """Rotations (n, 3, 3) about the vertical axis that turn vectors (n, 3) to the left."""
    cosine, sine = unit(left[:, :2])[:, ::-1].T
    zero, one = np.zeros_like(cosine), np.ones_like(cosine)
    rows = [[cosine, -sine, zero], [sine, cosine, zero], [zero, zero, one]]
    return np.array(rows).transpose(2, 0, 1)


def _placed(name: str, keypoints: np.ndarray) -> np.ndarray:
    """Where the standard body has a keypoint, given those that come before it: (n, 3)."""
    side, _, part = name.partition("_")
    if name == "spine":
        return (keypoints[:, INDEX["pelvis"]] + keypoints[:, INDEX["neck"]]) / 2
    parent = keypoints[:, INDEX[PARENTS[name]]]
    if part in ("index", "little"):  # in line with the forearm, thumb up
        forearm = unit(parent - keypoints[:, INDEX[f"{side}_elbow"]])
        far, wide = INDEX_ROOT if part == "index" else LITTLE_ROOT
        return parent + far * forearm + wide * unit(across(np.array([0.0, 0.0, 1.0]), forearm))
    return parent + STANDARD[INDEX[name]] - STANDARD[INDEX[PARENTS[name]]]
