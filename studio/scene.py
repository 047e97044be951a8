"""The robot in the page's scene, from the meshes and the shapes of its URDF."""

from dataclasses import dataclass

import numpy as np
import trimesh
import viser
from scipy.spatial.transform import Rotation

from gesture_bot.evaluate.raycast import half_extents
from gesture_bot.evaluate.robot_gif import facing, robot_shapes
from gesture_bot.retarget.kinematics import Kinematics, Shape
from gesture_bot.retarget.robot import Robot
from gesture_bot.studio.meshes import Meshes

STILL = 5e-4
"""A pose is sent once a joint has moved so far [rad]; a step of a servo is 1.5e-3."""

TURNED = 1e-4
"""What a link moves less than this is not sent [m, or half the angle in rad]."""

Color = tuple[int, int, int]


@dataclass
class _Batch:
    """Shapes that are drawn as one: their numbers among the robot's, and what is drawn."""

    members: list[int]
    drawn: viser.BatchedMeshHandle


class RobotView:
    """A robot that is shown at joint angles.

    Shapes of a kind are one batch, so that a pose is a few short messages, however many links there are. A
    link with meshes takes two of its own whenever it moves.

    Args:
        server: The page's server.
        name: Of its place in the scene, such as /robot.
        robot: Which.
        meshes: The looks of its links; simple shapes stand for those that have none.
        ghost: The one color of a robot that is seen through; None: it has its own.

    Attributes:
        root: The frame in which it stands; it faces along x.
        kinematics: At the angles that were shown last.
        floor: Height of its lowest point at rest [m].
        height: From there to its highest shape [m].
    """

    def __init__(
        self, server: viser.ViserServer, name: str, robot: Robot, meshes: Meshes, ghost: Color | None = None
    ):
        self.kinematics = Kinematics(robot)
        self._angles = np.full(len(robot.joints), np.nan)
        self._meshed = tuple(meshes.links)
        self.turn = facing(self.kinematics, robot)
        self.root = server.scene.add_frame(name, show_axes=False, wxyz=_quaternions(self.turn))
        shapes = robot_shapes(self.kinematics, self._meshed)
        self._batches = [
            _Batch(members, _drawn(server, f"{name}/{number}", [shapes[i] for i in members], ghost))
            for number, members in enumerate(_alike(shapes))
        ]
        self._links = np.array([self.kinematics.link(link) for link in self._meshed], int)
        self._drawn = [
            _drawn_meshes(server, f"{name}/mesh{number}", parts, ghost)
            for number, parts in enumerate(meshes.links.values())
        ]
        self._poses = np.full((len(self._links), 7), np.nan)
        self._place_meshes()
        heights = _heights(shapes) + [
            self.kinematics.position(link, corner)[2]
            for link, parts in meshes.links.items()
            for corner in trimesh.Scene(parts).bounding_box.vertices
        ]
        self.floor = float(min(heights))
        self.height = float(max(heights)) - self.floor

    @property
    def camera(self) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """From where it is seen first, and which point is in the middle [m]."""
        middle = self.floor + 0.45 * self.height
        position = 2.3 * self.height, 0.9 * self.height, middle + 0.5 * self.height
        return position, (0.0, 0.0, middle - 0.04 * self.height)

    def show(self, angles: np.ndarray) -> None:
        """Show it at (j,) joint angles [rad]; where one is not known, or none has moved, nothing changes."""
        if not np.isfinite(angles).all() or np.allclose(angles, self._angles, rtol=0, atol=STILL):
            return
        self._angles = angles.copy()
        self.kinematics.place(angles)
        self._place_meshes()
        shapes = robot_shapes(self.kinematics, self._meshed)
        if not shapes:
            return
        positions = np.array([shape.position for shape in shapes], np.float32)
        quaternions = _quaternions(np.array([shape.rotation for shape in shapes]))
        for batch in self._batches:
            batch.drawn.batched_positions = positions[batch.members]
            batch.drawn.batched_wxyzs = quaternions[batch.members]

    def _place_meshes(self) -> None:
        data = self.kinematics.data
        poses = np.hstack([data.xpos[self._links], data.xquat[self._links]])
        still = np.isclose(poses, self._poses, rtol=0, atol=TURNED).all(axis=1)
        for number in np.flatnonzero(~still):
            self._poses[number] = poses[number]
            self._drawn[number].position, self._drawn[number].wxyz = poses[number, :3], poses[number, 3:]


def _heights(shapes: list[Shape]) -> list[float]:
    """Where shapes begin and end [m]."""
    reach = [np.abs(shape.rotation[2]) @ half_extents(shape) for shape in shapes]
    return [
        float(shape.position[2] + way)
        for shape, half in zip(shapes, reach, strict=True)
        for way in (-half, half)
    ]


def _drawn_meshes(
    server: viser.ViserServer, name: str, meshes: list[trimesh.Trimesh], ghost: Color | None
) -> viser.GlbHandle | viser.MeshHandle:
    if not ghost:
        return server.scene.add_glb(name, trimesh.Scene(meshes).export(file_type="glb"))
    whole = trimesh.Scene(meshes).to_mesh()
    return server.scene.add_mesh_simple(
        name, whole.vertices, whole.faces, color=ghost, opacity=0.35, cast_shadow=False
    )


def _alike(shapes: list[Shape]) -> list[list[int]]:
    """The numbers of shapes that are one mesh, scaled: a capsule's ends must not be scaled."""
    groups: dict[object, list[int]] = {}
    for number, shape in enumerate(shapes):
        key = (shape.kind, *shape.size) if shape.kind == "capsule" else shape.kind
        groups.setdefault(key, []).append(number)
    return list(groups.values())


def _drawn(
    server: viser.ViserServer, name: str, shapes: list[Shape], ghost: Color | None
) -> viser.BatchedMeshHandle:
    mesh = _mesh(shapes[0])
    colors = np.array([ghost or 255 * shape.rgba[:3] for shape in shapes]).astype(np.uint8)
    return server.scene.add_batched_meshes_simple(
        name,
        mesh.vertices,
        mesh.faces,
        batched_wxyzs=_quaternions(np.array([shape.rotation for shape in shapes])),
        batched_positions=np.array([shape.position for shape in shapes]),
        batched_scales=np.array([_scale(shape) for shape in shapes], np.float32),
        batched_colors=colors,
        opacity=0.35 if ghost else None,
        lod="off",
        cast_shadow=not ghost,
    )


def _mesh(shape: Shape) -> trimesh.Trimesh:
    """A shape of size 1, or the capsule itself, its edges sharp."""
    if shape.kind == "box":
        mesh = trimesh.creation.box((2, 2, 2))
    elif shape.kind == "sphere":
        return trimesh.creation.icosphere(subdivisions=3)
    elif shape.kind == "cylinder":
        mesh = trimesh.creation.cylinder(radius=1, height=2, sections=48)
    else:
        return trimesh.creation.capsule(height=2 * shape.size[1], radius=shape.size[0])
    return trimesh.graph.smooth_shade(mesh, angle=0.5)


def _scale(shape: Shape) -> np.ndarray:
    radius, half = shape.size[:2]
    return {
        "box": shape.size,
        "sphere": np.full(3, radius),
        "cylinder": np.array([radius, radius, half]),
        "capsule": np.ones(3),
    }[shape.kind]


def _quaternions(rotations: np.ndarray) -> np.ndarray:
    """(..., 3, 3) -> (..., 4), the real part first."""
    return Rotation.from_matrix(rotations).as_quat()[..., [3, 0, 1, 2]].astype(np.float32)
