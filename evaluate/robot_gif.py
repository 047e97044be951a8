"""The robot, moving in an animated GIF or still, drawn from joint angles by forward kinematics."""

from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont
from scipy.spatial.transform import Rotation
from tqdm import tqdm

from gesture_bot.base.files import write_whole
from gesture_bot.evaluate.raycast import Camera, Picture, half_extents
from gesture_bot.retarget.kinematics import Kinematics, Shape
from gesture_bot.retarget.robot import Robot

_LONG_SIDE = 480
"""Width or height of the robot's picture, whichever is larger [pixels]."""

_CAPTION = 40
"""Height of the line below it [pixels]."""

_FONT = ImageFont.load_default(size=0.45 * _CAPTION)

_SAMPLES = 2
"""Rays a pixel, each way; their mean smooths the edges."""

_COLORS = 128
_BACKGROUND = (232, 238, 243)
_INK = (38, 48, 58)


def write_robot_gif(
    path: Path,
    robot: Robot,
    times: np.ndarray,
    positions: np.ndarray,
    fps: float = 10.0,
    captions: Sequence[str] | None = None,
) -> None:
    """Draw a motion of the robot, seen from its front left, in real time.

    Its primitive shapes are drawn, and boxes for its meshes, or lines from link to link where it has neither.

    Args:
        path: File to write, ending in .gif.
        robot: The robot.
        times: (n,) increasing moments [s].
        positions: (n, j) joint angles [rad], in the order of `robot.joints`.
        fps: Frames a second, rounded to what a GIF can say: 100 over a whole number.
        captions: A line of text for each of `times`, written below the robot from that moment on.
    """
    delay = max(2, round(100 / fps))  # [10 ms]; viewers slow down what is faster than 20 ms
    moments = times[0] + np.arange(0, times[-1] - times[0] + 1e-6, delay / 100)
    angles = np.stack([np.interp(moments, times, joint) for joint in np.asarray(positions).T], axis=1)
    scene = Scene(robot, angles)
    now = np.searchsorted(times, moments, side="right") - 1

    def frame(i: int) -> Image.Image:
        image = scene.image(i)
        return image if captions is None else _captioned(image, captions[now[i]])

    samples = [np.asarray(frame(i)) for i in range(0, len(moments), len(moments) // 8 + 1)]
    palette = Image.fromarray(np.concatenate(samples)).quantize(_COLORS)
    progress = tqdm(range(len(moments)), desc="film", unit="frame", leave=False, disable=None)
    frames = (frame(i).quantize(palette=palette, dither=Image.Dither.NONE) for i in progress)
    with write_whole(path) as temporary:
        next(frames).save(temporary, save_all=True, append_images=frames, duration=10 * delay, loop=0)


def write_robot_picture(path: Path, robot: Robot, angles: np.ndarray) -> None:
    """Draw the robot as it stands, seen from its front left.

    Args:
        path: File to write, ending in .png.
        robot: The robot.
        angles: (j,) joint angles [rad].
    """
    image = Scene(robot, angles[None]).image(0)
    with write_whole(path) as temporary:
        image.save(temporary)


class Scene:
    """A moving robot before a camera. What never moves is drawn once.

    Args:
        robot: The robot.
        angles: (n, j) joint angles [rad].
    """

    def __init__(self, robot: Robot, angles: np.ndarray):
        self.poses = poses = _poses(robot, angles)
        self.camera = _camera(poses)
        self.backdrop = Picture(self.camera, _table(self.camera, poses[0]))
        self.moving = []
        for i, shapes in enumerate(zip(*poses, strict=True)):
            if all(_together(shape, shapes[0]) for shape in shapes):
                self.backdrop.draw(shapes[0])
            else:
                self.moving.append(i)

    def image(self, pose: int) -> Image.Image:
        """The robot at the angles of one row."""
        picture = self.backdrop.copy()
        # Nearest first: what they hide need not be shaded.
        for shape in sorted((self.poses[pose][i] for i in self.moving), key=self.camera.depth):
            picture.draw(shape)
        return picture.image().reduce(_SAMPLES).convert("RGB")


def _captioned(image: Image.Image, line: str) -> Image.Image:
    captioned = Image.new("RGB", (image.width, image.height + _CAPTION), _BACKGROUND)
    captioned.paste(image)
    middle = (image.width / 2, image.height + _CAPTION / 2)
    ImageDraw.Draw(captioned).text(middle, line, _INK, _FONT, anchor="mm")
    return captioned


def _poses(robot: Robot, angles: np.ndarray) -> list[list[Shape]]:
    """The robot's shapes at each of the (n, j) joint angles."""
    kinematics = Kinematics(robot)
    turn = facing(kinematics, robot)
    poses = []
    for pose in angles:
        kinematics.place(pose)
        poses.append([_turned(shape, turn) for shape in robot_shapes(kinematics)])
    return poses


def facing(kinematics: Kinematics, robot: Robot) -> np.ndarray:
    """(3, 3) the turn about z after which a robot, as it is placed, looks along x."""
    x, y, _ = kinematics.rotation(robot.mapping.torso) @ robot.mapping.forward
    return Rotation.from_euler("z", -np.arctan2(y, x)).as_matrix()


def robot_shapes(kinematics: Kinematics, meshed: Collection[str] = ()) -> list[Shape]:
    """The shapes that a robot is drawn with, or lines from link to link where it has none.

    Args:
        kinematics: Of the robot.
        meshed: Links whose meshes are drawn, too.
    """
    shapes = kinematics.shapes(meshed)
    return shapes if shapes or meshed else [_line(*ends) for ends in kinematics.segments()]


def _turned(shape: Shape, rotation: np.ndarray) -> Shape:
    return replace(shape, position=rotation @ shape.position, rotation=rotation @ shape.rotation)


def _line(start: np.ndarray, end: np.ndarray) -> Shape:
    """A capsule between two points [m]."""
    length = np.linalg.norm(end - start)
    rotation = np.eye(3)
    if length > 0:
        rotation = Rotation.align_vectors([end - start], [[0, 0, 1]])[0].as_matrix()
    size = np.array([0.02, length / 2, 0])
    return Shape("capsule", size, (start + end) / 2, rotation, np.array([0.16, 0.55, 0.6, 1]))


def _together(shape: Shape, other: Shape) -> bool:
    return np.allclose(shape.position, other.position) and np.allclose(shape.rotation, other.rotation)


def _camera(poses: list[list[Shape]]) -> Camera:
    """A camera, front left and a little above, that has the whole motion in view."""
    positions = np.array([[shape.position for shape in shapes] for shapes in poses])
    reach = np.array([np.linalg.norm(half_extents(shape)) for shape in poses[0]])[:, None]
    low, high = (positions - reach).min(axis=(0, 1)), (positions + reach).max(axis=(0, 1))
    distance = 2.5 * np.linalg.norm(high - low)
    backward = np.array([1.0, 0.4, 0.22]) / np.linalg.norm([1.0, 0.4, 0.22])
    right = np.cross([0.0, 0.0, 1.0], backward)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(right, backward), -backward])
    position = (low + high) / 2 + distance * backward

    spots = Camera(position, axes, 1.0, np.zeros(2), (0, 0)).project(positions)
    first = (spots - reach / distance).min(axis=(0, 1))
    last = (spots + reach / distance).max(axis=(0, 1))
    focal = _SAMPLES * 0.94 * _LONG_SIDE / (last - first).max()
    width, height = _SAMPLES * np.round(focal / 0.94 * (last - first) / _SAMPLES).astype(int)
    center = np.array([width, height]) / 2 - focal * (first + last) / 2
    return Camera(position, axes, focal, center, (width, height))


def _table(camera: Camera, shapes: list[Shape]) -> np.ndarray:
    """A plain background with a soft shadow below the robot's lowest shape: (3, height, width), 0 to 255."""
    lowest = min(shapes, key=lambda shape: shape.position[2])
    ground = lowest.position - [0, 0, half_extents(lowest)[2]]
    t = (ground[2] - camera.position[2]) / camera.rays[2]
    spot = camera.position[:, None, None] + t * camera.rays - ground[:, None, None]
    away = np.hypot(spot[0], spot[1]) / np.linalg.norm(half_extents(lowest)[:2])
    shadow = np.where(t > 0, 0.3 * np.exp(-(away**4)), 0)
    return np.array(_BACKGROUND)[:, None, None] * (1 - shadow)
