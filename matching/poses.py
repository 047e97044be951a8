"""Poses of semantic banks in words: where a hand is, where palm and fingers point, how the head is held."""

from typing import Annotated, Any

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationInfo,
    model_validator,
)

from gesture_bot.matching.arms import Side

DIRECTIONS = {
    "forward": (1, 0, 0),
    "back": (-1, 0, 0),
    "out": (0, 1, 0),
    "in": (0, -1, 0),
    "up": (0, 0, 1),
    "down": (0, 0, -1),
}
"""Named directions of the left arm; for the right arm, `out` and `in` are mirrored."""


def vector(direction: str, side: Side) -> np.ndarray:
    """(3,) vector of a direction in the pelvis frame; several names mean the direction between them."""
    forward, outward, up = np.sum([DIRECTIONS[name] for name in direction.split()], axis=0)
    return np.array([forward, outward if side == "left" else -outward, up], np.float64)


def _known(direction: str) -> str:
    names = direction.split()
    if not names or not set(names) <= set(DIRECTIONS) or not vector(direction, "left").any():
        raise ValueError(f"is no direction: one or more of {', '.join(DIRECTIONS)}, like 'forward up'")
    return direction


Direction = Annotated[str, AfterValidator(_known)]


class Strict(BaseModel):
    """A part of a bank: a key that it does not know is an error."""

    model_config = ConfigDict(frozen=True, allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _no_other_keys(cls, part: object) -> object:
        known = [field.alias or name for name, field in cls.model_fields.items()]
        for key in part if isinstance(part, dict) else ():
            if key not in known:
                raise ValueError(f"has no {key}: one of {', '.join(known)}")
        return part


class Place(Strict):
    """Where a wrist is, from its shoulder, in lengths of the stretched arm."""

    forward: float = Field(0.0, ge=-1, le=1)
    out: float = Field(0.0, ge=-1, le=1)
    up: float = Field(0.0, ge=-1, le=1)


class ArmPose(Strict):
    """A pose of one arm: where the wrist is, and where palm, fingers and elbow point.

    Without `fingers` the hand goes on from the forearm; without `elbow` the elbow hangs naturally.
    """

    wrist: Place
    palm: Direction
    fingers: Direction | None = None
    elbow: Direction | None = None


class HeadPose(Strict):
    """How far the head is turned from where it would be [degrees]: nodded down, turned left, tilted left."""

    nod: float = Field(0.0, ge=-45, le=45)
    turn: float = Field(0.0, ge=-80, le=80)
    tilt: float = Field(0.0, ge=-45, le=45)


def context(info: ValidationInfo) -> dict[str, Any]:
    """What is known beside the bank itself: arm `poses` by name, and the bank's `folder`."""
    assert info.context is not None
    return info.context


def _named(pose: object, info: ValidationInfo) -> object:
    if not isinstance(pose, str):
        return pose
    poses = context(info)["poses"]
    if pose not in poses:
        raise ValueError(f"is no pose: one of {', '.join(sorted(poses))}, or {{wrist: ..., palm: ...}}")
    return poses[pose]


NamedArmPose = Annotated[ArmPose, BeforeValidator(_named)]
"""An ArmPose, or the name of one of the poses in the context."""
