"""Semantic banks: gestures that mean something, as readable keyframes in YAML (MM22)."""

from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, RootModel, model_validator

from gesture_bot.base.errors import FileFormatError
from gesture_bot.base.files import config_dir, read_yaml
from gesture_bot.matching.arms import SIDES, Side

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


def _plain(phrase: str) -> str:
    if phrase != " ".join(phrase.lower().split()) or not phrase:
        raise ValueError("is no trigger: lower-case words with single spaces between them")
    return phrase


Trigger = Annotated[str, AfterValidator(_plain)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Place(_Strict):
    """Where a wrist is, from its shoulder, in lengths of the stretched arm."""

    forward: float = Field(0.0, ge=-1, le=1)
    out: float = Field(0.0, ge=-1, le=1)
    up: float = Field(0.0, ge=-1, le=1)


class ArmPose(_Strict):
    """A pose of one arm: where the wrist is, and where palm, fingers and elbow point.

    Without `fingers` the hand goes on from the forearm; without `elbow` the elbow hangs naturally.
    """

    wrist: Place
    palm: Direction
    fingers: Direction | None = None
    elbow: Direction | None = None


class HeadPose(_Strict):
    """How far the head is turned from where it would be [degrees]: nodded down, turned left, tilted left."""

    nod: float = Field(0.0, ge=-45, le=45)
    turn: float = Field(0.0, ge=-80, le=80)
    tilt: float = Field(0.0, ge=-45, le=45)


class Keyframe(_Strict):
    """A pose reached and left at rest, `time` seconds after the stroke.

    An arm or the head that is not named stays as in the keyframe before. `both` is `left` and `right` at
    once, mirrored.
    """

    time: float
    left: ArmPose | None = None
    right: ArmPose | None = None
    both: ArmPose | None = None
    head: HeadPose | None = None

    def arm(self, side: Side) -> ArmPose | None:
        """The pose of one arm, if this keyframe names it."""
        return (self.left if side == "left" else self.right) or self.both


class Gesture(_Strict):
    """A gesture of a bank.

    Attributes:
        triggers: Words and phrases that call it.
        preparation: From the pose before to the first keyframe [s].
        retraction: From the last keyframe to rest [s].
        cooldown: After a stroke, the same gesture is not made again for so long [s].
        keyframes: In the order of time; the stroke is at time 0.
    """

    triggers: tuple[Trigger, ...] = Field(min_length=1)
    preparation: float = Field(0.6, gt=0, le=3)
    retraction: float = Field(0.7, gt=0, le=3)
    cooldown: float = Field(3.0, ge=0)
    keyframes: tuple[Keyframe, ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _check_keyframes(self) -> "Gesture":
        times = [keyframe.time for keyframe in self.keyframes]
        if any(later <= earlier for earlier, later in pairwise(times)):
            raise ValueError(f"the times of the keyframes must rise, and are {times}")
        if not times[0] <= 0 <= times[-1]:
            raise ValueError(f"the stroke, time 0, must lie within the keyframes, whose times are {times}")
        for side in SIDES:
            named = [keyframe.arm(side) is not None for keyframe in self.keyframes]
            if any(named) and not named[0]:
                raise ValueError(f"the first keyframe must pose the {side} arm, because a later one does")
        if any(keyframe.both and (keyframe.left or keyframe.right) for keyframe in self.keyframes):
            raise ValueError("a keyframe poses `both` arms or `left` and `right`, not all of them")
        return self


class _Bank(RootModel[dict[str, Gesture]]):
    pass


def load_banks(folder: Path | None = None) -> dict[str, Gesture]:
    """Read every gesture of the *.yaml banks in a folder, config/banks by default.

    Raises:
        FileFormatError: A bank does not fit (names the key and what is valid there), or two gestures share
            a name or a trigger.
    """
    gestures: dict[str, Gesture] = {}
    callers: dict[str, str] = {}
    for path in sorted((folder or config_dir() / "banks").glob("*.yaml")):
        for name, gesture in read_yaml(path, _Bank).root.items():
            if name in gestures:
                raise FileFormatError(f"{path}: a gesture of this name is there already", name)
            gestures[name] = gesture
            for phrase in gesture.triggers:
                if phrase in callers:
                    raise FileFormatError(f"{path}: {name} has a trigger of {callers[phrase]}", phrase)
                callers[phrase] = name
    return gestures


def triggers(gestures: Mapping[str, Gesture]) -> dict[str, str]:
    """The gesture that each word or phrase calls."""
    return {phrase: name for name, gesture in gestures.items() for phrase in gesture.triggers}
