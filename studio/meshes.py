"""The meshes of a robot's URDF, link by link, light enough for a browser."""

import os
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation
from trimesh.visual import TextureVisuals
from trimesh.visual.material import PBRMaterial, SimpleMaterial

from gesture_bot.base.errors import RobotError
from gesture_bot.retarget.robot import Robot

FACES = 60_000
"""Triangles of a whole robot; where its meshes have more, the large ones are simplified."""

LARGEST = 20_000_000
"""A larger file is not read: that would take longer than people wait for a page [bytes]."""

FEWEST = 200
"""Triangles that each mesh keeps."""

COLOR = (158, 171, 184)
"""Of a mesh that tells none, as of the boxes of retarget/urdf_model.py."""


@dataclass
class Meshes:
    """What a robot's links look like.

    Attributes:
        links: The looks of each link whose meshes can all be shown, in the link's frame [m].
        troubles: Why others cannot, in words, by link.
    """

    links: dict[str, list[trimesh.Trimesh]] = field(default_factory=dict)
    troubles: dict[str, str] = field(default_factory=dict)


def load_meshes(robot: Robot) -> Meshes:
    """Read the meshes that a robot's URDF names for looks; what cannot be read is told, and left out."""
    root, meshes = ElementTree.fromstring(robot.urdf), Meshes()
    colors = {material.get("name"): _color(material) for material in root.findall("material")}
    for link in root.findall("link"):
        visuals = [visual for visual in link.findall("visual") if visual.find("geometry/mesh") is not None]
        name = link.get("name", "")
        try:
            if parts := [part for visual in visuals for part in _read(visual, robot.folder, colors)]:
                meshes.links[name] = parts
        except (RobotError, ValueError) as error:
            meshes.troubles[name] = str(error)
    _simplify(meshes)
    return meshes


def mesh_file(name: str, folder: Path | None) -> Path:
    """Where a mesh of a URDF is: a path, from its folder on, or package://PACKAGE/PATH.

    A package is looked for where the URDF is itself, then in the ROS workspace (AMENT_PREFIX_PATH).

    Raises:
        RobotError: It is not there.
    """
    scheme, _, rest = name.rpartition("://")
    places = [Path(rest)] if folder is None else [folder / rest]
    if scheme == "package":
        prefixes = filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep))
        places += [parent / rest for parent in (folder.parents if folder else ())]
        places += [Path(prefix) / "share" / rest for prefix in prefixes]
    found = next((place for place in places if place.is_file()), None)
    if found is None:
        raise RobotError("cannot find the mesh", name)
    return found


def _read(
    visual: ElementTree.Element, folder: Path | None, colors: dict[str | None, np.ndarray | None]
) -> Iterator[trimesh.Trimesh]:
    """The meshes of one <visual>, in its link's frame."""
    mesh = visual.find("geometry/mesh")
    assert mesh is not None
    path = mesh_file(mesh.get("filename", ""), folder)
    if path.stat().st_size > LARGEST:
        raise RobotError(f"the mesh {path} has more than {LARGEST / 1e6:.0f} MB")
    try:
        scene = trimesh.load_scene(path)
        if path.suffix.lower() == ".dae" and scene.units:
            scene = scene.convert_units("meters")
    except Exception as error:  # what its readers raise where a file is broken is of many kinds
        raise RobotError(f"cannot read the mesh {path} ({error!r})") from error
    material = visual.find("material")
    color = None
    if material is not None:
        color = _color(material) if material.find("color") is not None else colors.get(material.get("name"))
    place = _place(visual.find("origin")) @ np.diag([*_numbers(mesh.get("scale"), (1.0, 1.0, 1.0)), 1.0])
    for part in scene.dump():
        if isinstance(part, trimesh.Trimesh) and len(part.faces):
            part.apply_transform(place)
            _paint(part, color)
            yield part


def _paint(mesh: trimesh.Trimesh, color: np.ndarray | None) -> None:
    """Give a mesh that has no colors of its own one; what shines as metal would be black without a room."""
    look: Any = mesh.visual
    if isinstance(look, TextureVisuals):
        material: Any = look.material
        look.material = material = material.to_pbr() if isinstance(material, SimpleMaterial) else material
        material.alphaMode, material.metallicFactor = "OPAQUE", 0.0
    elif look is None or look.kind is None:
        mesh.visual = _plain(np.array(COLOR) if color is None else color)


def _plain(color: np.ndarray) -> TextureVisuals:
    """One color (3,), 0 to 255, for a whole mesh."""
    factor = [*np.asarray(color, float)[:3] / 255, 1.0]
    return TextureVisuals(
        material=PBRMaterial(baseColorFactor=factor, metallicFactor=0.0, roughnessFactor=0.7)
    )


def _simplify(meshes: Meshes) -> None:
    """Take triangles from the large meshes, so that all have no more than FACES."""
    counts = np.array([len(mesh.faces) for parts in meshes.links.values() for mesh in parts])
    if counts.sum() <= FACES:
        return
    share = FACES / counts.sum()
    for link, parts in meshes.links.items():
        meshes.links[link] = [_simpler(mesh, max(FEWEST, int(share * len(mesh.faces)))) for mesh in parts]


def _simpler(mesh: trimesh.Trimesh, faces: int) -> trimesh.Trimesh:
    if len(mesh.faces) <= faces:
        return mesh
    colors: Any = mesh.visual.to_color() if isinstance(mesh.visual, TextureVisuals) else mesh.visual
    simple = mesh.simplify_quadric_decimation(face_count=faces)
    simple.visual = _plain(np.atleast_2d(colors.vertex_colors).mean(axis=0))
    return simple


def _color(material: ElementTree.Element) -> np.ndarray | None:
    """(3,) the color of a <material>, 0 to 255."""
    color = material.find("color")
    return None if color is None else 255 * np.array(_numbers(color.get("rgba"), (1.0, 1.0, 1.0, 1.0))[:3])


def _place(origin: ElementTree.Element | None) -> np.ndarray:
    """(4, 4) where an <origin> is."""
    place, given = np.eye(4), {} if origin is None else origin.attrib
    place[:3, :3] = Rotation.from_euler("xyz", _numbers(given.get("rpy"), (0.0, 0.0, 0.0))).as_matrix()
    place[:3, 3] = _numbers(given.get("xyz"), (0.0, 0.0, 0.0))
    return place


def _numbers(text: str | None, default: tuple[float, ...]) -> tuple[float, ...]:
    return default if text is None else tuple(map(float, text.split()))
