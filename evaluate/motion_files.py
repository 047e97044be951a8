"""Motion in files that other tools read: BVH for people, CSV for robots."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from pybvh import Bvh
from pybvh.bvhnode import BvhEndSite, BvhJoint, BvhNode, BvhRoot
from scipy.spatial.transform import Rotation

from gesture_bot.base.files import write_whole
from gesture_bot.base.keypoints import INDEX, KEYPOINTS, PARENTS, bone_lengths

_BVH_AXES = (1, 2, 0)  # BVH viewers take x as left, y as up and z as forward
_CM = 100.0

_T_POSE = {
    "spine": (0, 1, 0), "neck": (0, 1, 0), "head": (0, 1, 0), "head_top": (0, 1, 0),
    "left_hip": (1, 0, 0), "right_hip": (-1, 0, 0),
    "left_shoulder": (1, 0, 0), "left_elbow": (1, 0, 0), "left_wrist": (1, 0, 0),
    "left_index": (0.96, 0, 0.28), "left_little": (0.96, 0, -0.28),
    "right_shoulder": (-1, 0, 0), "right_elbow": (-1, 0, 0), "right_wrist": (-1, 0, 0),
    "right_index": (-0.96, 0, 0.28), "right_little": (-0.96, 0, -0.28),
}  # fmt: skip
"""Direction of the bone that ends in each keypoint in the BVH rest pose, BVH axes: arms out, palms down."""

_CHILDREN = {name: [child for child, parent in PARENTS.items() if parent == name] for name in KEYPOINTS}


def write_bvh(path: Path, keypoints: np.ndarray, fps: float) -> None:
    """Write human motion as BVH: Y up, facing +Z, centimetres, rest pose with arms out and palms down.

    Each keypoint is a joint of that name. Where several bones leave a keypoint (pelvis, neck, wrists) its
    rotation is the one that fits them all best, and each bone has one more joint in the same place,
    `to_NAME`, that brings it into its exact direction. Bone lengths are the means over the motion.

    Args:
        path: File to write, ending in .bvh.
        keypoints: (n, 17, 3) positions [m], x forward, y left, z up.
        fps: Frames a second.
    """
    positions = np.asarray(keypoints, np.float64)[..., _BVH_AXES] * _CM
    directions = {
        child: positions[:, INDEX[child]] - positions[:, INDEX[parent]] for child, parent in PARENTS.items()
    }
    directions = {name: bone / np.linalg.norm(bone, axis=1)[:, None] for name, bone in directions.items()}
    lengths = dict(zip(PARENTS, bone_lengths(positions).mean(axis=0), strict=True))
    nodes: list[BvhNode] = []
    rotations: list[Rotation] = []

    def add(name: str, parent: BvhJoint | None, offset: np.ndarray, aims: list[str], frame: Rotation) -> None:
        """Add a joint that turns towards the keypoints `aims`, and all that hangs from it."""
        joint = BvhJoint(name, offset, parent=parent) if parent else BvhRoot(name)
        nodes.append(joint)
        if parent:
            parent.children.append(joint)
        if not aims:
            joint.children.append(BvhEndSite(f"{name}_end", np.zeros(3), joint))
            nodes.append(joint.children[0])
        rotation = _turn(aims, [frame.inv().apply(directions[aim]) for aim in aims], len(positions))
        rotations.append(rotation)
        for aim in aims:
            if len(aims) > 1:
                add(f"to_{aim}", joint, np.zeros(3), [aim], frame * rotation)
            else:
                add(aim, joint, lengths[aim] * np.array(_T_POSE[aim]), _CHILDREN[aim], frame * rotation)

    add("pelvis", None, np.zeros(3), _CHILDREN["pelvis"], Rotation.identity(len(positions)))
    matrices = np.stack([rotation.as_matrix() for rotation in rotations], axis=1)
    motion = Bvh(nodes, positions[:, 0], np.zeros(matrices.shape[:-1]), 1 / fps, world_up="+y")
    motion.from_rotmat(positions[:, 0], matrices, inplace=True)
    with write_whole(path) as temporary:
        motion.write(temporary)


def _turn(aims: list[str], directions: list[np.ndarray], frames: int) -> Rotation:
    """The smallest rotation, each frame, that brings bones from the rest pose closest to their directions."""
    if not aims:
        return Rotation.identity(frames)
    rest = np.array([_T_POSE[aim] for aim in aims])
    if len(aims) > 1:
        return Rotation.concatenate(
            [Rotation.align_vectors(seen, rest)[0] for seen in zip(*directions, strict=True)]
        )
    # Half-way between no turn and the turn by twice the angle, as quaternions.
    axis, cosine = np.cross(rest[0], directions[0]), directions[0] @ rest[0]
    return Rotation.from_quat(np.column_stack([axis, 1 + cosine]))


def write_joint_csv(path: Path, joints: Sequence[str], times: np.ndarray, positions: np.ndarray) -> None:
    """Write joint angles as CSV: a header `time,JOINT,...`, then a row for each moment.

    Args:
        path: File to write.
        joints: The j joint names.
        times: (n,) moments [s].
        positions: (n, j) joint angles [rad].
    """
    with write_whole(path) as temporary:
        np.savetxt(
            temporary,
            np.column_stack([times, positions]),
            fmt="%.6f",
            delimiter=",",
            header=",".join(["time", *joints]),
            comments="",
        )
