"""Motion files, read back by tools that did not write them."""

import csv

import bvhio
import numpy as np
import pytest

from gesture_bot.base.keypoints import BONES, INDEX, KEYPOINTS, PARENTS
from gesture_bot.evaluate.motion_files import write_bvh, write_joint_csv

FRAMES = 24


@pytest.fixture(scope="module")
def keypoints() -> np.ndarray:
    """A body whose every bone wanders on its own, in any direction, with constant lengths."""
    random = np.random.default_rng(0)
    middle, sway, phase = random.normal(size=(3, 16, 3))
    time = np.linspace(0, 3, FRAMES)[:, None, None]
    directions = middle + 0.5 * sway * np.sin(2 * time + phase)
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    body = np.zeros((FRAMES, len(KEYPOINTS), 3))
    body[:, 0] = 0.1 * np.sin(time[:, 0])
    for bone, (child, parent) in enumerate(PARENTS.items()):
        body[:, INDEX[child]] = body[:, INDEX[parent]] + (0.1 + 0.02 * bone) * directions[:, bone]
    return body


@pytest.fixture(scope="module")
def read_back(keypoints, tmp_path_factory) -> np.ndarray:
    """The keypoints after a trip through a BVH file, back in metres with x forward, y left, z up."""
    path = tmp_path_factory.mktemp("bvh") / "motion.bvh"
    write_bvh(path, keypoints, 15)
    root = bvhio.readAsHierarchy(str(path))
    body = np.empty_like(keypoints)
    for frame in range(len(keypoints)):
        root.loadPose(frame)
        for joint, _, _ in root.layout():
            if joint.Name in INDEX:
                left, up, forward = joint.PositionWorld
                body[frame, INDEX[joint.Name]] = np.array([forward, left, up]) / 100
    return body


def test_bvh_has_the_same_keypoints(keypoints, read_back):
    assert np.linalg.norm(read_back - keypoints, axis=-1).max() < 1e-4


def test_bvh_has_the_same_bone_directions(keypoints, read_back):
    def directions(body: np.ndarray) -> np.ndarray:
        bones = np.stack([body[:, child] - body[:, parent] for parent, child in BONES], axis=1)
        return bones / np.linalg.norm(bones, axis=-1, keepdims=True)

    assert np.abs(directions(read_back) - directions(keypoints)).max() < 1e-4


def test_bvh_keeps_the_frame_rate(keypoints, tmp_path):
    write_bvh(tmp_path / "a.bvh", keypoints, 15)
    motion = bvhio.readAsBvh(str(tmp_path / "a.bvh"))
    assert motion.FrameCount == FRAMES
    assert motion.FrameTime == pytest.approx(1 / 15)


def test_the_same_motion_gives_the_same_file(keypoints, tmp_path):
    for name in ("a.bvh", "b.bvh"):
        write_bvh(tmp_path / name, keypoints, 15)
    assert (tmp_path / "a.bvh").read_bytes() == (tmp_path / "b.bvh").read_bytes()


def test_csv_has_a_header_and_a_row_for_each_moment(tmp_path):
    times = 1.7e9 + np.array([0.0, 0.02, 0.04])
    positions = np.array([[0.1, -0.2], [0.3, 1.25], [-3.0, 0.0]])
    write_joint_csv(tmp_path / "joints.csv", ["head_pan", "head_tilt"], times, positions)
    with (tmp_path / "joints.csv").open(newline="") as file:
        header, *rows = csv.reader(file)
    assert header == ["time", "head_pan", "head_tilt"]
    np.testing.assert_allclose(np.array(rows, float), np.column_stack([times, positions]), atol=1e-6, rtol=0)
