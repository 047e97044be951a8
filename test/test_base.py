"""What every room shares: files, the frame grid, keypoints, joint trajectories."""

import os
import stat
import subprocess
import sys

import numpy as np
import pytest
from pydantic import BaseModel
from small_database import small_database

from gesture_bot.base.errors import FileFormatError
from gesture_bot.base.files import cache_dir, read_yaml, write_whole
from gesture_bot.base.frames import first_frame_after, frame_time
from gesture_bot.base.keypoints import BONES, INDEX, bone_lengths, mirror, with_bone_lengths
from gesture_bot.base.trajectory import JointTrajectory

KEYPOINTS = small_database(recordings=2).keypoints[:50].astype(np.float64)


class Settings(BaseModel):
    speed: float
    name: str = "toa"


@pytest.mark.parametrize("module", ["speech.transcriber", "speech.activity", "refine.model"])
def test_onnxruntime_tells_its_maker_nothing(tmp_path, module):
    """It would make a number for this computer, and a queue of what it reports, when it is imported."""
    told = ("XDG_", "ORT_", "CI", "GITHUB_")  # where it keeps things, and whether it tells
    environment = {name: value for name, value in os.environ.items() if not name.startswith(told)}
    environment |= {"HOME": str(tmp_path)}
    subprocess.run(
        [sys.executable, "-c", f"import gesture_bot.{module}, onnxruntime"], env=environment, check=True
    )
    assert not list(tmp_path.rglob("*onnxruntime*"))


def test_a_file_is_written_whole_with_the_usual_permissions(tmp_path):
    path = tmp_path / "new" / "a.txt"
    with write_whole(path) as temporary:
        temporary.write_text("new")
        assert not path.exists()
    assert path.read_text() == "new"
    usual = path.with_name("usual")
    usual.touch()
    assert stat.S_IMODE(path.stat().st_mode) == stat.S_IMODE(usual.stat().st_mode)


def test_an_interrupted_write_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")
    with pytest.raises(KeyboardInterrupt), write_whole(path) as temporary:
        temporary.write_text("half")
        raise KeyboardInterrupt
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["a.txt"]


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("name: toa", "speed.*required"),
        ("speed: fast", "speed.*number.*'fast'"),
        ("- 1", "the file"),
        ("speed: [1", "not YAML.*line"),
        (None, "No such file"),
    ],
)
def test_a_wrong_settings_file_is_named_with_its_key(tmp_path, text, named):
    path = tmp_path / "settings.yaml"
    if text is not None:
        path.write_text(text)
    with pytest.raises(FileFormatError, match=rf"settings\.yaml.*{named}") as caught:
        read_yaml(path, Settings)
    assert "\n" not in str(caught.value)


def test_a_cache_folder_that_cannot_be_made_is_named(monkeypatch, tmp_path):
    (tmp_path / "occupied").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "occupied"))
    with pytest.raises(FileFormatError, match="occupied/gesture_bot") as caught:
        cache_dir()
    assert "\n" not in str(caught.value)


def test_a_frame_is_the_first_one_after_its_own_stamp():
    frames = 1_780_000_000 * 15 + np.arange(1000)
    for frame in map(int, frames):
        assert first_frame_after(frame_time(frame)) == frame
        second, nanosecond = divmod(round(frame * 10**9 / 15), 10**9)
        assert first_frame_after(second + 1e-9 * nanosecond) == frame
        assert first_frame_after(frame_time(frame) + 0.001) == frame + 1


def test_the_mirror_swaps_the_hands_and_undoes_itself():
    mirrored = mirror(KEYPOINTS)
    left, right = INDEX["left_wrist"], INDEX["right_wrist"]
    np.testing.assert_array_equal(mirrored[:, left], KEYPOINTS[:, right] * [1, -1, 1])
    np.testing.assert_array_equal(mirror(mirrored), KEYPOINTS)


def test_bone_lengths_change_and_directions_stay():
    lengths = np.linspace(0.1, 0.5, len(BONES))
    changed = with_bone_lengths(KEYPOINTS, lengths)
    np.testing.assert_allclose(bone_lengths(changed), np.tile(lengths, (50, 1)))
    parents, children = np.array(BONES).T
    before, after = (body[:, children] - body[:, parents] for body in (KEYPOINTS, changed))
    np.testing.assert_allclose(
        after / lengths[:, None], before / bone_lengths(KEYPOINTS)[..., None], atol=1e-9
    )


@pytest.fixture
def trajectory():
    times = 1_780_000_000 + np.array([0.0, 0.5, 1.0])
    since = (times - times[0])[:, None]
    return JointTrajectory(("pan", "tilt"), times, since**2 * [1, -2], 2 * since * [1, -2])


def test_a_trajectory_between_its_points(trajectory):
    positions, velocities = trajectory.at(trajectory.times[0] + 0.75)
    assert positions == pytest.approx([0.75**2, -2 * 0.75**2])
    assert velocities == pytest.approx([1.5, -3.0])


def test_a_trajectory_is_still_before_and_after(trajectory):
    positions, velocities = trajectory.at(trajectory.times[[0, -1]] + [-1.0, 1.0])
    np.testing.assert_allclose(positions, trajectory.positions[[0, -1]], atol=1e-12)
    assert not velocities.any()


def test_a_trajectory_at_many_moments_is_that_at_each(trajectory):
    moments = trajectory.times[0] + np.linspace(-0.5, 1.5, 9)
    positions, velocities = trajectory.at(moments)
    assert positions.shape == velocities.shape == (9, 2)
    for moment, position, velocity in zip(moments, positions, velocities, strict=True):
        np.testing.assert_array_equal(trajectory.at(moment), (position, velocity))


def test_a_single_point_is_held():
    point = JointTrajectory(("pan",), np.array([5.0]), np.array([[0.3]]), np.array([[1.0]]))
    positions, velocities = point.at(np.array([4.0, 5.0, 6.0]))
    np.testing.assert_array_equal(positions, [[0.3]] * 3)
    assert not velocities.any()
