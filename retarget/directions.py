"""What a robot imitates of a person: directions in the torso's frame, whatever the size of the body."""

import numpy as np

from gesture_bot.base.keypoints import INDEX

DIRECTIONS = (
    "left_upper_arm", "left_forearm", "left_palm",
    "right_upper_arm", "right_forearm", "right_palm",
    "face", "hands",
)  # fmt: skip
"""The rows of every (..., 8, 3) array of directions. A palm points out of it, the face where it looks;
`hands` is the way from the right wrist to the left, in lengths of an arm."""

HEAD_LEAN = 0.18
"""How far the line from the neck to the top of the head leans forward when one looks straight ahead [rad]."""


def directions(keypoints: np.ndarray) -> np.ndarray:
    """Directions of arms, palms and face, in the torso's frame: x forward, y left, z up.

    The torso's z axis runs from spine to neck, its y axis lies in the plane of that and the shoulders. A
    palm is taken across the forearm and shortened as the hand bends, since a bent hand's palm says little
    of the forearm's roll.

    Args:
        keypoints: (..., 17, 3) positions [m].

    Returns:
        (..., 8, 3) vectors, rows as in DIRECTIONS, of unit length but for the palms, which are shorter, and
        the hands. An arm's are zero where its keypoints coincide.
    """
    at = {name: keypoints[..., index, :] for name, index in INDEX.items()}
    up = _unit(at["neck"] - at["spine"])
    left = _unit(_across(at["left_shoulder"] - at["right_shoulder"], up))
    forward = np.cross(left, up)
    rows, lengths = [], []
    for side, sign in (("left", -1.0), ("right", 1.0)):
        bones = at[f"{side}_elbow"] - at[f"{side}_shoulder"], at[f"{side}_wrist"] - at[f"{side}_elbow"]
        lengths += [np.linalg.norm(bone, axis=-1, keepdims=True) for bone in bones]
        upper_arm, forearm = map(_unit, bones)
        knuckles = at[f"{side}_index"] - at[f"{side}_wrist"], at[f"{side}_little"] - at[f"{side}_wrist"]
        palm = sign * _unit(np.cross(*knuckles))
        rows += [upper_arm, forearm, _across(palm, forearm)]
    hands = 2 * (at["left_wrist"] - at["right_wrist"]) / np.maximum(sum(lengths), 1e-9)
    torso = np.stack([forward, left, up], axis=-1)
    crown = _unit(at["head_top"] - at["neck"])
    seen = np.stack([*rows, crown, hands], axis=-2) @ torso
    return np.concatenate([seen[..., :6, :], _face(seen[..., 6:7, :]), seen[..., 7:, :]], axis=-2)


def _face(crown: np.ndarray) -> np.ndarray:
    """Where the face looks, from the direction of the head's top, both in the torso's frame.

    Keypoints hardly tell a turned head from one that leans to the side. Both turn the face here, about half
    as far as if the head had only turned.
    """
    x, y, z = np.moveaxis(crown, -1, 0)
    turn = np.arctan2(y, np.maximum(x, 0.0) + HEAD_LEAN)
    nod = np.arctan2(x * np.cos(turn) + y * np.sin(turn), z) - HEAD_LEAN
    return np.stack([np.cos(nod) * np.cos(turn), np.cos(nod) * np.sin(turn), -np.sin(nod)], axis=-1)


def _across(vectors: np.ndarray, axis: np.ndarray) -> np.ndarray:
    return vectors - np.sum(vectors * axis, axis=-1, keepdims=True) * axis


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-9)
