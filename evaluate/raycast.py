"""A small picture of simple shapes: each is met by the rays of its pixels, and the nearest one is shaded."""

import copy
from dataclasses import dataclass, field

import numpy as np
from PIL import Image

from gesture_bot.retarget.kinematics import Shape

_BEVEL = np.float32(0.006)
"""Edges of boxes and cylinders are shaded as if they were rounded this much [m]."""

_LIGHT = np.array([0.70, -0.20, 0.69], np.float32)
"""Where the light comes from."""

_GLOSS = np.array([0.80, 0.05, 0.60], np.float32)
"""Where a surface faces when it mirrors the light into the camera."""

_TINY = np.float32(1e-12)
"""What stands for zero where it divides."""

_CORNERS = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])


@dataclass(frozen=True)
class Camera:
    """A pinhole camera.

    Attributes:
        position: (3,) [m].
        axes: (3, 3) rows: right, down and forward in the world.
        focal: Focal length [pixels].
        center: Where the optical axis meets the picture: x and y [pixels].
        size: Width and height [pixels].
        rays: (3, height, width) world directions of the pixels' rays, one metre deep along the view.
    """

    position: np.ndarray
    axes: np.ndarray
    focal: float
    center: np.ndarray
    size: tuple[int, int]
    rays: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        width, height = self.size
        u, v = np.meshgrid(np.arange(width) + 0.5 - self.center[0], np.arange(height) + 0.5 - self.center[1])
        seen = np.stack([u / self.focal, v / self.focal, np.ones_like(u)])
        rays = np.tensordot(self.axes.T, seen, axes=1).astype(np.float32)
        object.__setattr__(self, "rays", rays)

    def depth(self, shape: Shape) -> float:
        """How far along the view the middle of a shape is [m]."""
        return (shape.position - self.position) @ self.axes[2]

    def project(self, points: np.ndarray) -> np.ndarray:
        """Pixels at which points are seen: (..., 3) [m] -> (..., 2)."""
        seen = (points - self.position) @ self.axes.T
        return self.focal * seen[..., :2] / seen[..., 2:] + self.center


class Picture:
    """What a camera sees.

    Attributes:
        pixels: (height, width) colors, as the bytes red, green, blue, 0 of a uint32.
        depth: (height, width) how far along the view [m].
    """

    def __init__(self, camera: Camera, background: np.ndarray):
        self.camera = camera
        self.pixels = _packed(background.reshape(3, -1)).reshape(background.shape[1:])
        self.depth = np.full(background.shape[1:], np.inf, np.float32)

    def copy(self) -> "Picture":
        """The same picture, to draw more into."""
        picture = copy.copy(self)
        picture.pixels, picture.depth = self.pixels.copy(), self.depth.copy()
        return picture

    def image(self) -> Image.Image:
        """The picture."""
        return Image.frombuffer("RGBX", self.camera.size, self.pixels, "raw", "RGBX", 0, 1)

    def draw(self, shape: Shape) -> None:
        """Draw a shape, but for what is behind nearer shapes."""
        half = half_extents(shape)
        corners = self.camera.project(shape.position + _CORNERS * half @ shape.rotation.T)
        left, top = np.maximum(np.floor(corners.min(axis=0)).astype(int), 0)
        right, bottom = np.ceil(corners.max(axis=0)).astype(int)
        part = np.s_[top:bottom, left:right]
        turned = shape.rotation.astype(np.float32)
        rays = turned.T @ self.camera.rays[:, *part].reshape(3, -1)
        origin = ((self.camera.position - shape.position) @ shape.rotation).astype(np.float32)[:, None]
        half = half.astype(np.float32)[:, None]
        t = _meet(shape.kind, half, origin, rays).reshape(self.depth[part].shape)
        seen = t < self.depth[part]
        t = t[seen]
        self.depth[part][seen] = t
        normals = turned @ _normals(shape.kind, half, origin + t * rays[:, seen.ravel()])
        self.pixels[part][seen] = _packed(_shade(shape.rgba[:3].astype(np.float32), normals))


def half_extents(shape: Shape) -> np.ndarray:
    """(3,) half lengths of the box around a shape, along its own axes [m]."""
    radius, half = shape.size[:2]
    if shape.kind == "box":
        return shape.size
    if shape.kind == "sphere":
        return np.full(3, radius)
    return np.array([radius, radius, half + radius if shape.kind == "capsule" else half])


def _meet(kind: str, half: np.ndarray, origin: np.ndarray, rays: np.ndarray) -> np.ndarray:
    """How far along each of the (3, n) rays a shape begins; infinite where the ray misses it."""
    with np.errstate(divide="ignore", invalid="ignore"):
        if kind == "box":
            nears, fars = _between(origin, rays, half)
            return _begin(nears.max(axis=0), fars.min(axis=0))
        if kind == "sphere":
            return _begin(*_round(origin, rays, half[0]))
        near, far = _round(origin[:2], rays[:2], half[0])
        if kind == "cylinder":
            bottom, top = _between(origin[2], rays[2], half[2])
            return _begin(np.maximum(near, bottom), np.minimum(far, top))
        end = np.array([[0], [0], [1]], np.float32) * (half[2] - half[0])
        bottom, top = _between(origin[2], rays[2], end[2])
        sides = _begin(np.maximum(near, bottom), np.minimum(far, top))
        caps = [_begin(*_round(origin + middle, rays, half[0])) for middle in (-end, end)]
        return np.minimum(sides, np.minimum(*caps))


def _begin(near: np.ndarray, far: np.ndarray) -> np.ndarray:
    return np.where(near < far, near, np.float32(np.inf))


def _round(origin: np.ndarray, rays: np.ndarray, radius: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where rays enter and leave a sphere, or a circle in two dimensions; NaN where they do not."""
    a = np.maximum(np.einsum("ij,ij->j", rays, rays), _TINY)
    b = origin[:, 0] @ rays
    root = np.sqrt(b * b - a * (origin[:, 0] @ origin[:, 0] - radius**2))
    return (-b - root) / a, (-b + root) / a


def _between(origin: np.ndarray, rays: np.ndarray, half: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where rays enter and leave the space between the planes at -half and half."""
    inverse = 1 / np.where(rays == 0, _TINY, rays)
    middle, reach = -origin * inverse, np.abs(half * inverse)
    return middle - reach, middle + reach


def _normals(kind: str, half: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Directions away from the surface at (3, n) points on it, bent over the edges."""
    if kind in ("sphere", "capsule"):
        reach = half[2] - half[0]
        points[2] -= np.clip(points[2], -reach, reach)
        return points / half[0]
    depth = np.abs(points)
    if kind == "cylinder":
        depth[:2] = np.sqrt(points[0] ** 2 + points[1] ** 2)
    bend = np.minimum(_BEVEL, half / 2)
    normals = points / np.maximum(depth, _TINY) * np.clip((depth - half) / bend + 1, 0, 1)
    return normals / np.sqrt(np.einsum("ij,ij->j", normals, normals))


def _shade(color: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """(3, n) colors, 0 to 255, of surfaces with (3, n) normals."""
    tone = 0.62 + 0.08 * normals[2] + 0.38 * np.maximum(_LIGHT @ normals, 0)
    gloss = 0.15 * np.maximum(_GLOSS @ normals, 0) ** 32
    return 255 * np.minimum(color[:, None] * tone + gloss, 1)


def _packed(colors: np.ndarray) -> np.ndarray:
    """(3, n) colors, 0 to 255, as (n,) pixels."""
    pixels = np.zeros((colors.shape[1], 4), np.uint8)
    pixels[:, :3] = colors.T
    return pixels.view(np.uint32)[:, 0]
