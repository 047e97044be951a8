"""The demo speaker's body: hands, torso and head in, 17 keypoints with constant bone lengths out."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from gesture_bot.base.keypoints import INDEX, KEYPOINTS, mirror
from gesture_bot.base.vectors import across, length, unit
from gesture_bot.corpus.movement import minimum_jerk

UPPER_ARM = 0.29
FOREARM = 0.25
REACH = 0.98 * (UPPER_ARM + FOREARM)
NECK = np.array([0.0, 0.0, 0.50])
SPINE = NECK / 2
HIP = np.array([0.0, 0.10, -0.05])
SHOULDER = np.array([0.0, 0.18, -0.03])
HEAD = np.array([0.02, 0.0, 0.12])
HEAD_TOP = np.array([0.03, 0.0, 0.16])
INDEX_ROOT = np.array([0.075, 0.028])
LITTLE_ROOT = np.array([0.068, -0.030])
TRUNK = np.array([0.15, 0.19])
"""Sizes of an adult [m]: finger roots along and across the hand, the trunk's half depth and half width."""

ROLL, FLEX = 3, 4
HAND_STATE = 5
"""A hand: wrist x, y, z [m] in the chest's frame with y outward, roll [rad] of the forearm (0 thumb up,
positive palm down, negative palm up), flexion [rad] of the wrist towards the palm."""

_ARM = ("shoulder", "elbow", "wrist", "index", "little")
_LEFT_ARM = [INDEX[f"left_{part}"] for part in _ARM]
_RIGHT_ARM = [INDEX[f"right_{part}"] for part in _ARM]


@dataclass(frozen=True)
class Posture:
    """How the whole body is held, over n frames.

    Attributes:
        left, right: (n, HAND_STATE) hands.
        torso: (n, 3) roll, pitch, yaw of the chest [rad]; pitch leans forward, yaw turns left.
        head: (n, 3) roll, pitch, yaw of the head on the chest [rad].
        elbows: How far the elbows point outward, from 0 (down) to 1 (sideways).
    """

    left: np.ndarray
    right: np.ndarray
    torso: np.ndarray
    head: np.ndarray
    elbows: float


def pose(posture: Posture) -> np.ndarray:
    """Keypoints of a posture: (n, 17, 3) positions [m], pelvis frame, x forward, y left, z up."""
    frames = len(posture.torso)
    chest = Rotation.from_euler("xyz", posture.torso)
    keypoints = np.zeros((frames, len(KEYPOINTS), 3))
    # The right arm is built as a left one and mirrored.
    keypoints[:, _LEFT_ARM] = _arm(posture.right, posture.elbows)
    keypoints = mirror(keypoints)
    keypoints[:, _LEFT_ARM] = _arm(posture.left, posture.elbows)

    waist = Rotation.from_euler("xyz", posture.torso / 2).apply(SPINE)
    neck = waist + chest.apply(NECK - SPINE)
    for keypoint in (*_LEFT_ARM, *_RIGHT_ARM):
        keypoints[:, keypoint] = neck + chest.apply(keypoints[:, keypoint] - NECK)
    keypoints[:, INDEX["spine"]] = waist
    keypoints[:, INDEX["neck"]] = neck
    head = neck + (chest * Rotation.from_euler("xyz", posture.head / 2)).apply(HEAD)
    crown = head + (chest * Rotation.from_euler("xyz", posture.head)).apply(HEAD_TOP)
    keypoints[:, INDEX["head"]] = head
    keypoints[:, INDEX["head_top"]] = crown
    keypoints[:, INDEX["left_hip"]] = HIP
    keypoints[:, INDEX["right_hip"]] = HIP * (1, -1, 1)
    return keypoints


def _arm(hand: np.ndarray, elbows: float) -> np.ndarray:
    """The left arm: (n, HAND_STATE) -> (n, 5, 3) shoulder, elbow, wrist, index, little, chest's frame."""
    wrist = _outside_trunk(hand[:, :3])
    shoulder = NECK + _shrugged(wrist)
    line = wrist - shoulder
    distance = length(line)
    reached = _soft_limit(distance, REACH)
    along = line / distance

    # Two-bone inverse kinematics. An elbow naturally swivels down, a little outward and back.
    swivel = unit(across(np.array([-0.3, 0.15 + elbows, -1.0]), along))
    foot = (UPPER_ARM**2 - FOREARM**2 + reached**2) / (2 * reached)
    elbow = shoulder + foot * along + np.sqrt(UPPER_ARM**2 - foot**2) * swivel
    wrist = shoulder + reached * along

    forearm = (wrist - elbow) / FOREARM
    upward = -unit(across(swivel, forearm))
    inward = np.cross(forearm, upward)
    roll, flex = hand[:, ROLL, None], hand[:, FLEX, None]
    thumb = np.cos(roll) * upward + np.sin(roll) * inward
    palm = np.cos(roll) * inward - np.sin(roll) * upward
    pointing = np.cos(flex) * forearm + np.sin(flex) * palm
    index, little = (wrist + far * pointing + wide * thumb for far, wide in (INDEX_ROOT, LITTLE_ROOT))
    return np.stack([shoulder, elbow, wrist, index, little], axis=1)


def _shrugged(wrist: np.ndarray) -> np.ndarray:
    """The shoulder from the neck: it rises with a high hand."""
    angle = 0.3 * minimum_jerk((wrist[:, 2:] - 0.25) / 0.35)
    cos, sin = np.cos(angle), np.sin(angle)
    x, y, z = SHOULDER
    return np.concatenate([np.full_like(angle, x), y * cos - z * sin, y * sin + z * cos], axis=1)


def _outside_trunk(wrist: np.ndarray) -> np.ndarray:
    """Wrists pushed out of the trunk, an upright elliptic cylinder; the push fades in over centimetres."""
    radius = length(wrist[:, :2] / TRUNK)
    pushed = 1.0 + np.logaddexp(0.0, 12.0 * (radius - 1.0)) / 12.0
    out = wrist.copy()
    out[:, :2] *= pushed / np.maximum(radius, 1e-6)
    return out


def _soft_limit(value: np.ndarray, limit: float) -> np.ndarray:
    """The value [m], bent within a few centimetres of the limit so that it stays below."""
    return limit - np.logaddexp(0.0, 60.0 * (limit - value)) / 60.0
