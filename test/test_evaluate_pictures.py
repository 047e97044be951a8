"""The robot's GIF and the timeline: they show what they are given."""

import dataclasses
import re

import numpy as np
import pytest
from PIL import Image

from gesture_bot.evaluate.raycast import Camera, Picture
from gesture_bot.evaluate.robot_gif import write_robot_gif
from gesture_bot.evaluate.timeline import Span, Timeline, WristHeights, write_timeline
from gesture_bot.retarget.kinematics import Shape
from gesture_bot.retarget.robot import Robot, load_robot

EPOCH = 1.7e9
TIMES = EPOCH + np.arange(0, 1.001, 0.02)


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot("toa")


def waving(robot: Robot) -> np.ndarray:
    """The left elbow bends, all else rests."""
    positions = np.tile(robot.rest, (len(TIMES), 1))
    positions[:, robot.joints.index("left_elbow")] += np.linspace(0, 1.5, len(TIMES))
    return positions


def frames(path) -> list[np.ndarray]:
    with Image.open(path) as gif:
        pictures = []
        for frame in range(gif.n_frames):
            gif.seek(frame)
            pictures.append(np.asarray(gif.convert("RGB"), int))
        return pictures


def test_the_gif_lasts_as_long_as_the_motion(robot, tmp_path):
    write_robot_gif(tmp_path / "a.gif", robot, TIMES, waving(robot), fps=10)
    with Image.open(tmp_path / "a.gif") as gif:
        assert gif.n_frames == 11
        assert gif.info["duration"] == 100
        assert max(gif.size) == 480


def test_what_moves_in_the_gif_is_what_moves(robot, tmp_path):
    write_robot_gif(tmp_path / "a.gif", robot, TIMES, waving(robot), fps=10)
    first, *_, last = frames(tmp_path / "a.gif")
    changed = np.abs(last - first).max(axis=2) > 60
    assert changed.sum() > 500
    # The robot faces us: its left arm is in the right half of the picture.
    assert not changed[:, : changed.shape[1] // 2].any()


def test_captions_change_with_time(robot, tmp_path):
    still = np.tile(robot.rest, (len(TIMES), 1))
    captions = ["hello" if time < EPOCH + 0.5 else "" for time in TIMES]
    write_robot_gif(tmp_path / "a.gif", robot, TIMES, still, fps=10, captions=captions)
    first, *_, last = frames(tmp_path / "a.gif")
    changed = np.abs(last - first).max(axis=2) > 60
    assert changed[-40:].any()
    assert not changed[:-40].any()


def test_a_robot_without_shapes_is_drawn_as_lines(robot, tmp_path):
    bare = dataclasses.replace(robot, urdf=re.sub("<visual>.*?</visual>", "", robot.urdf, flags=re.DOTALL))
    write_robot_gif(tmp_path / "a.gif", bare, TIMES, waving(robot), fps=5)
    first, *_, last = frames(tmp_path / "a.gif")
    assert (np.abs(last - first).max(axis=2) > 60).sum() > 500


def test_one_sample_is_one_frame(robot, tmp_path):
    write_robot_gif(tmp_path / "a.gif", robot, TIMES[:1], robot.rest[None])
    assert len(frames(tmp_path / "a.gif")) == 1


@pytest.mark.parametrize(
    ("kind", "size", "depth"),
    [
        ("box", [0.2, 0.3, 0.4], 2 - 0.4),
        ("cylinder", [0.2, 0.3, 0], 2 - 0.3),
        ("sphere", [0.25, 0, 0], 2 - 0.25),
        ("capsule", [0.2, 0.3, 0], 2 - 0.5),
    ],
)
def test_rays_meet_shapes_where_they_are(kind, size, depth):
    """Seen from 2 m above, the nearest point of each shape is its upper end."""
    axes = np.array([[1.0, 0, 0], [0, -1, 0], [0, 0, -1]])
    picture = Picture(
        Camera(np.array([0, 0, 2.0]), axes, 100.0, np.array([50.5, 50.5]), (101, 101)),
        np.zeros((3, 101, 101)),
    )
    picture.draw(Shape(kind, np.array(size), np.zeros(3), np.eye(3), np.ones(4)))
    assert picture.depth[50, 50] == pytest.approx(depth, abs=1e-5)
    assert picture.depth.min() == pytest.approx(depth, abs=1e-5)
    assert np.isinf(picture.depth[0, 0])


def test_near_shapes_hide_far_ones_in_either_order():
    axes = np.array([[1.0, 0, 0], [0, -1, 0], [0, 0, -1]])
    camera = Camera(np.array([0, 0, 2.0]), axes, 100.0, np.array([50.0, 50.0]), (100, 100))
    near = Shape("sphere", np.array([0.1, 0, 0]), np.array([0, 0, 0.5]), np.eye(3), np.array([1.0, 0, 0, 1]))
    far = Shape("box", np.array([0.3, 0.3, 0.1]), np.zeros(3), np.eye(3), np.array([0, 0, 1.0, 1]))
    pictures = []
    for shapes in ((near, far), (far, near)):
        picture = Picture(camera, np.zeros((3, 100, 100)))
        for shape in shapes:
            picture.draw(shape)
        pictures.append(np.asarray(picture.image().convert("RGB"), int))
    np.testing.assert_array_equal(*pictures)
    red, _, blue = pictures[0][50, 50]
    assert red > 2 * blue


def run(seconds: float) -> Timeline:
    """A run with a bit of everything."""
    times = EPOCH + np.arange(0, seconds, 0.02)
    wrists = WristHeights(times, 0.3 + 0.1 * np.sin(times), 0.2 + 0.1 * np.cos(times))
    hello = Span(EPOCH + 0.5, EPOCH + 1, "hello")
    return Timeline(
        samples=np.sin(np.arange(int(16_000 * seconds)) / 20).astype(np.float32),
        sample_rate=16_000,
        start=EPOCH,
        words=(hello, Span(EPOCH + 1, EPOCH + 1.2, "I"), Span(EPOCH + 1.2, EPOCH + 1.5, "am $x$")),
        keywords=(hello,),
        strokes=(EPOCH + 0.9,),
        windows=(
            Span(EPOCH, EPOCH + 1.5, "wave", "bank"),
            Span(EPOCH + 1.5, EPOCH + seconds, "happy 3", "speech"),
        ),
        planned=wrists,
        moved=wrists,
        emotions=(Span(EPOCH, EPOCH + seconds, "happy"),),
        controls=(Span(EPOCH, EPOCH + 2, "wrist_height"), Span(EPOCH + 1, EPOCH + 2, "wrist_speed")),
        teleop=(Span(EPOCH + 1, EPOCH + 2, "left arm"),),
    )


def test_a_longer_run_gets_more_rows(tmp_path):
    heights = []
    for seconds in (10, 20):
        write_timeline(tmp_path / "a.png", run(seconds))
        with Image.open(tmp_path / "a.png") as picture:
            assert picture.width == 1600
            assert (np.asarray(picture.convert("L")) < 250).mean() > 0.05
            heights.append(picture.height)
    assert heights[1] > 1.8 * heights[0]


def test_an_empty_run_is_drawn_too(tmp_path):
    nothing = WristHeights(np.empty(0), np.empty(0), np.empty(0))
    empty = Timeline(np.empty(0), 16_000, EPOCH, (), (), (), (), nothing, nothing, (), (), ())
    write_timeline(tmp_path / "a.png", empty)
    assert (tmp_path / "a.png").stat().st_size > 1000
