"""Keypoints in the page's scene: what was chosen and what became of it, as stick figures beside the robot."""

import numpy as np
import trimesh
import viser

from gesture_bot.base.frames import FRAME_RATE, KeypointClip
from gesture_bot.base.keypoints import BONES, KEYPOINTS
from gesture_bot.studio.scene import Color

JOINT = 0.022
"""Radius of a keypoint, for a person's size [m]."""

KEPT = 2 * FRAME_RATE
"""Frames that are kept after they were seen."""


class Frames:
    """Keypoints by the frame in which they are seen; a clip replaces all from its first frame on."""

    def __init__(self) -> None:
        self._frames: dict[int, np.ndarray] = {}

    def add(self, clip: KeypointClip) -> None:
        """Take in a clip."""
        self._frames = {k: v for k, v in self._frames.items() if clip.start - KEPT <= k < clip.start}
        self._frames.update(enumerate(clip.keypoints, clip.start))

    def at(self, moment: float) -> np.ndarray | None:
        """(17, 3) the keypoints seen at a moment [s since the epoch]; None where there are none."""
        return self._frames.get(int(moment * FRAME_RATE))


class Figure:
    """A stick figure.

    Args:
        server: The page's server.
        name: Of its place in the scene.
        color: Its color.
        position: Where its pelvis is [m].
        size: How large it is drawn, 1 as a person.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        name: str,
        color: Color,
        position: tuple[float, float, float],
        size: float,
    ):
        self.frames = Frames()
        self._shown: np.ndarray | None = None
        self._size = size
        self.root = server.scene.add_frame(name, show_axes=False, position=position, visible=False)
        ball = trimesh.creation.icosphere(subdivisions=2, radius=JOINT * size)
        count = len(KEYPOINTS)
        self._joints = server.scene.add_batched_meshes_simple(
            f"{name}/joints",
            ball.vertices,
            ball.faces,
            batched_wxyzs=np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
            batched_positions=np.zeros((count, 3)),
            batched_colors=color,
            lod="off",
        )
        self._bones = server.scene.add_line_segments(
            f"{name}/bones", np.zeros((len(BONES), 2, 3), np.float32), colors=color, line_width=4.0
        )

    def show(self, moment: float) -> None:
        """Show the frame of a moment [s since the epoch], if the figure is switched on."""
        keypoints = self.frames.at(moment)
        if keypoints is None or keypoints is self._shown or not self.root.visible:
            return
        self._shown = keypoints
        points = (self._size * (keypoints - keypoints[0])).astype(np.float32)
        self._joints.batched_positions = points
        self._bones.points = points[np.array(BONES)]
