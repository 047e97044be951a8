"""The skeleton: the 13 upper-body joints of LSG21 and the finger roots that MM22 matches on."""

import numpy as np

KEYPOINTS = (
    "pelvis", "spine", "neck", "head", "head_top",
    "left_hip", "right_hip",
    "left_shoulder", "left_elbow", "left_wrist", "left_index", "left_little",
    "right_shoulder", "right_elbow", "right_wrist", "right_index", "right_little",
)  # fmt: skip
"""The 17 keypoints, in the order of every (..., 17, 3) array. `index` and `little` are finger roots."""

INDEX = {name: i for i, name in enumerate(KEYPOINTS)}

WRISTS = [INDEX["left_wrist"], INDEX["right_wrist"]]
"""Left and right, by index."""

PARENTS = {
    "spine": "pelvis", "neck": "spine", "head": "neck", "head_top": "head",
    "left_hip": "pelvis", "right_hip": "pelvis",
    "left_shoulder": "neck", "left_elbow": "left_shoulder", "left_wrist": "left_elbow",
    "left_index": "left_wrist", "left_little": "left_wrist",
    "right_shoulder": "neck", "right_elbow": "right_shoulder", "right_wrist": "right_elbow",
    "right_index": "right_wrist", "right_little": "right_wrist",
}  # fmt: skip
"""Parent of each keypoint but the pelvis; parents come before their children."""

BONES = tuple((INDEX[parent], INDEX[child]) for child, parent in PARENTS.items())
"""Parent and child of each of the 16 bones, by index; a parent is placed before its children."""

IN_ARM = np.array([name.endswith(("elbow", "wrist", "index", "little")) for name in KEYPOINTS])
"""(17,) bool: the keypoints of both arms; the others are trunk, head, shoulders and hips."""

MATCHED = tuple(
    f"{side}_{part}" for side in ("left", "right") for part in ("wrist", "elbow", "index", "little")
)
"""The 8 keypoints of the pose feature (MM22)."""

_MIRRORED = [
    INDEX[name.replace("left", "right") if "left" in name else name.replace("right", "left")]
    for name in KEYPOINTS
]


def mirror(keypoints: np.ndarray) -> np.ndarray:
    """The same gesture made with the other hand.

    Args:
        keypoints: (..., 17, 3) positions [m], pelvis frame.
    """
    return keypoints[..., _MIRRORED, :] * np.array([1, -1, 1], keypoints.dtype)


def bone_vectors(keypoints: np.ndarray) -> np.ndarray:
    """Each of BONES from its parent to its child: (..., 17, 3) -> (..., 16, 3) [m]."""
    parents, children = np.array(BONES).T
    return keypoints[..., children, :] - keypoints[..., parents, :]


def from_bone_vectors(vectors: np.ndarray) -> np.ndarray:
    """Keypoints with the pelvis at the origin: (..., 16, 3) -> (..., 17, 3) [m]."""
    keypoints = np.zeros((*vectors.shape[:-2], len(KEYPOINTS), 3), vectors.dtype)
    for bone, (parent, child) in enumerate(BONES):
        keypoints[..., child, :] = keypoints[..., parent, :] + vectors[..., bone, :]
    return keypoints


def bone_lengths(keypoints: np.ndarray) -> np.ndarray:
    """Length of each of BONES: (..., 17, 3) -> (..., 16) [m]."""
    return np.linalg.norm(bone_vectors(keypoints), axis=-1)


def with_bone_lengths(keypoints: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """The same directions with given bone lengths, the pelvis kept.

    Averaging poses shortens limbs; this undoes it.

    Args:
        keypoints: (..., 17, 3) positions [m].
        lengths: (..., 16) length of each of BONES [m].
    """
    out = keypoints.copy()
    for bone, (parent, child) in enumerate(BONES):
        bone_vector = keypoints[..., child, :] - keypoints[..., parent, :]
        norm = np.linalg.norm(bone_vector, axis=-1, keepdims=True)
        scale = lengths[..., bone, None] / np.maximum(norm, 1e-9)
        out[..., child, :] = out[..., parent, :] + scale * bone_vector
    return out
