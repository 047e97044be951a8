"""An arm as directions: two-bone inverse kinematics with constant bone lengths and a natural elbow."""

from collections.abc import Sequence
from dataclasses import astuple, dataclass
from typing import Literal

import numpy as np

from gesture_bot.base.keypoints import INDEX
from gesture_bot.base.vectors import across, length, unit

Side = Literal["left", "right"]

SIDES: tuple[Side, ...] = ("left", "right")

STRETCHED = 0.999
"""Share of the arm's length beyond which it is not stretched, so that the elbow keeps its side."""

_JOINTS = ("shoulder", "elbow", "wrist", "index", "little")


def natural_elbow(side: Side) -> np.ndarray:
    """(3,) where an elbow points of itself: down, a little outward and back."""
    return np.array([-0.3, 0.4 if side == "left" else -0.4, -1.0])


@dataclass(frozen=True)
class Arm:
    """One arm over n frames, by vectors in the pelvis frame.

    Attributes:
        wrist: (n, 3) from the shoulder to the wrist [m].
        elbow: (n, 3) the side to which the elbow points.
        fingers: (n, 3) along the hand.
        palm: (n, 3) out of the palm.
    """

    wrist: np.ndarray
    elbow: np.ndarray
    fingers: np.ndarray
    palm: np.ndarray

    @classmethod
    def of(cls, keypoints: np.ndarray, side: Side) -> "Arm":
        """The arm of (n, 17, 3) keypoints."""
        shoulder, elbow, wrist, index, little = _joints(keypoints, side)
        line = wrist - shoulder
        to_index, to_little = unit(index - wrist), unit(little - wrist)
        # A straight arm has no elbow side of its own: the natural one, too little to be seen otherwise.
        aside = across(elbow - shoulder, unit(line)) + 1e-3 * natural_elbow(side)
        palm = np.cross(to_index, to_little) * (1 if side == "right" else -1)
        return cls(line, unit(aside), unit(to_index + to_little), unit(palm))

    @classmethod
    def stacked(cls, arms: Sequence["Arm"]) -> "Arm":
        """One arm over n frames from n arms whose vectors are (3,)."""
        return cls(*(np.stack(vectors) for vectors in zip(*map(astuple, arms), strict=True)))

    def at(self, frames: np.ndarray) -> "Arm":
        """The arm at some of its frames, by index."""
        return Arm(self.wrist[frames], self.elbow[frames], self.fingers[frames], self.palm[frames])

    def mixed(self, other: "Arm", share: np.ndarray) -> "Arm":
        """This arm where share (n,) is 0, the other where it is 1; between them, wrists go on arcs."""
        return Arm(
            _turned(self.wrist, other.wrist, share),
            _turned(self.elbow, other.elbow, share),
            _turned(self.fingers, other.fingers, share),
            _turned(self.palm, other.palm, share),
        )

    def on(self, keypoints: np.ndarray, side: Side) -> np.ndarray:
        """Keypoints (n, 17, 3) [m] with this arm instead of theirs, of the same bone lengths."""
        shoulder, old_elbow, old_wrist, old_index, old_little = _joints(keypoints, side)
        upper, fore = length(old_elbow - shoulder), length(old_wrist - old_elbow)
        along, bend = _bent(self.wrist, self.elbow, upper, fore)
        elbow = shoulder + bend
        wrist = shoulder + along

        fingers = unit(self.fingers)
        palm = unit(across(self.palm, fingers))
        thumbward = np.cross(fingers, palm) * (1 if side == "right" else -1)
        to_index, to_little = old_index - old_wrist, old_little - old_wrist
        half = np.arccos(np.clip(np.sum(unit(to_index) * unit(to_little), -1, keepdims=True), -1, 1)) / 2
        index = wrist + length(to_index) * (np.cos(half) * fingers + np.sin(half) * thumbward)
        little = wrist + length(to_little) * (np.cos(half) * fingers - np.sin(half) * thumbward)

        out = keypoints.copy()
        for joint, place in zip(_JOINTS[1:], (elbow, wrist, index, little), strict=True):
            out[:, INDEX[f"{side}_{joint}"]] = place
        return out


def reach(body: np.ndarray, side: Side) -> float:
    """Length of the stretched arm [m] of a body (17, 3), from shoulder to wrist."""
    shoulder, elbow, wrist = (body[INDEX[f"{side}_{joint}"]] for joint in _JOINTS[:3])
    return float(np.linalg.norm(elbow - shoulder) + np.linalg.norm(wrist - elbow))


def forearm(wrist: np.ndarray, elbow: np.ndarray, upper: np.ndarray, fore: np.ndarray) -> np.ndarray:
    """(n, 3) direction of the forearm, from wrist and elbow as in Arm and bone lengths (n, 1) [m]."""
    along, bend = _bent(wrist, elbow, upper, fore)
    return unit(along - bend)


def _bent(
    wrist: np.ndarray, elbow: np.ndarray, upper: np.ndarray, fore: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Vectors from the shoulder to the wrist, brought within reach, and to the elbow."""
    direction = unit(wrist)
    reach = np.clip(length(wrist), 1.1 * np.abs(upper - fore) + 1e-3, STRETCHED * (upper + fore))
    foot = (upper**2 - fore**2 + reach**2) / (2 * reach)
    height = np.sqrt(np.maximum(upper**2 - foot**2, 0))
    return reach * direction, foot * direction + height * unit(across(elbow, direction))


def _joints(keypoints: np.ndarray, side: Side) -> list[np.ndarray]:
    return [keypoints[:, INDEX[f"{side}_{joint}"]] for joint in _JOINTS]


def _turned(start: np.ndarray, goal: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Vectors turned from start to goal on the great circle, their lengths in proportion."""
    share = share[:, None]
    a, b = unit(start), unit(goal)
    angle = np.arccos(np.clip(np.sum(a * b, axis=-1, keepdims=True), -1, 1))
    towards = unit(across(b, a))
    turned = np.cos(share * angle) * a + np.sin(share * angle) * towards
    return (length(start) + share * (length(goal) - length(start))) * turned
