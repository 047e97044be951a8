"""What the selector has planned: windows one after another on the frame grid."""

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from gesture_bot.base.frames import FRAME_RATE, KeypointClip
from gesture_bot.matching.controls import Constraint

Source = Literal["speech", "rest", "bank"]


@dataclass(frozen=True)
class Window(KeypointClip):
    """Frames that the selector has chosen, and where they come from.

    Attributes:
        start: Index of the first frame on the grid.
        keypoints: (n, 17, 3) positions [m], pelvis frame.
        source: `speech`: found by the search; `rest`: nobody speaks; `bank`: a semantic gesture.
        name: Gesture of the semantic bank.
        sequence: Index of the sequence in the database.
        frame: The window's first frame in that sequence.
        pose_distance: Of the search; see search.Match.
        audio_distance: Of the search.
        candidates: Sequences that the search chose from.
        shown: (n,) what each frame shows [frames of the sequence from `frame` on]; empty without a sequence.
        amplitude: How far the arms of the last frame go from rest, against the recording.
        stroke: When the gesture's stroke is to be seen, at its word or later [s since the epoch]; NaN where
            there is none. The keyframe of the stroke is strokes.lead earlier.
        kept: Bounds that the search kept; see controls.Admission.
    """

    source: Source
    name: str = ""
    sequence: int = -1
    frame: int = -1
    pose_distance: float = 0.0
    audio_distance: float = 0.0
    candidates: int = 0
    shown: np.ndarray = field(default_factory=lambda: np.zeros(0))
    amplitude: float = 1.0
    stroke: float = np.nan
    kept: tuple[Constraint, ...] = ()


class Plan:
    """Windows without a gap or an overlap, beginning with a pose that is held."""

    def __init__(self, start: int, pose: np.ndarray) -> None:
        self.windows = [Window(start - 1, pose[None], "rest")]

    @property
    def last(self) -> Window:
        """The last window."""
        return self.windows[-1]

    @property
    def end(self) -> int:
        """The frame after the last one planned."""
        return self.last.stop

    def add(self, window: Window) -> None:
        """Plan a window; it replaces everything from its first frame on."""
        self.cut(window.start)
        self.windows.append(window)

    def cut(self, frame: int) -> None:
        """Drop everything from a frame on; the very first frame that is kept stays."""
        kept = [window for window in self.windows[1:] if window.start < frame]
        self.windows[1:] = kept
        self.windows[-1] = replace(
            self.last, keypoints=self.last.keypoints[: max(1, frame - self.last.start)]
        )

    def hold(self, until: int) -> None:
        """Hold the last pose up to a frame."""
        if until > self.end:
            held = np.repeat(self.last.keypoints[-1:], until - self.end, axis=0)
            self.windows.append(Window(self.end, held, "rest"))

    def forget(self, before: int) -> None:
        """Drop the windows that are over before a frame; the last one stays."""
        self.windows = [window for window in self.windows if window.stop > before] or [self.last]

    def pose_and_velocity(self) -> tuple[np.ndarray, np.ndarray]:
        """(17, 3) the last pose [m], and its velocity within its window [m/s]."""
        keypoints = self.last.keypoints
        return keypoints[-1], (keypoints[-1] - keypoints[-2:][0]) * FRAME_RATE
