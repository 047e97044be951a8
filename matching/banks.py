"""Semantic banks: gestures that mean something, in YAML, and the words that call them (MM22, section 4.2)."""

from collections.abc import Mapping
from contextlib import suppress
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Annotated, Protocol

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo, field_validator, model_validator

from gesture_bot.base.errors import FileFormatError
from gesture_bot.base.files import config_dir, read_yaml, yaml_place
from gesture_bot.matching.arms import Arm, Side
from gesture_bot.matching.expressions import Label
from gesture_bot.matching.keyframes import Keyframe, Keyframes, checked
from gesture_bot.matching.poses import ArmPose, Strict, context
from gesture_bot.matching.spans import Span


class Movement(Protocol):
    """How arms and head move; all times are from the stroke [s]."""

    @property
    def first(self) -> float:
        """When the movement begins."""
        ...

    @property
    def last(self) -> float:
        """When it ends."""
        ...

    @property
    def moments(self) -> np.ndarray:
        """(n,) when it is worth a look."""
        ...

    def arm(self, side: Side, times: np.ndarray, body: np.ndarray) -> Arm | None:
        """One arm of a body (17, 3) at (n,) moments; None where it has no part."""
        ...

    def head(self, times: np.ndarray) -> np.ndarray:
        """(n, 3) how far the head is turned about x, y and z at (n,) moments [degrees]."""
        ...


def _plain(phrase: str) -> str:
    if phrase != " ".join(phrase.lower().split()) or not phrase:
        raise ValueError("is no trigger: lower-case words with single spaces between them")
    return phrase


class Trigger(Strict):
    """A word or phrase that calls a gesture, and its weight; see Gesture."""

    phrase: Annotated[str, AfterValidator(_plain)]
    weight: float = Field(1.0, gt=0)


def _weighted(trigger: object) -> object:
    if isinstance(trigger, dict) and len(trigger) == 1:
        ((phrase, weight),) = trigger.items()
        return {"phrase": phrase, "weight": weight}
    return {"phrase": trigger}


class Motion(Strict):
    """How a gesture is made: by keyframes or by a span of a recording.

    Attributes:
        preparation: From the pose before to the first keyframe, or to the span [s].
        retraction: From its end to rest [s].
        keyframes: In the order of time; the stroke is at time 0.
        recording: The span.
    """

    preparation: float = Field(0.6, gt=0, le=3)
    retraction: float = Field(0.7, gt=0, le=3)
    keyframes: Annotated[list[Keyframe], Field(min_length=1), AfterValidator(checked)] | None = None
    recording: Span | None = None

    @model_validator(mode="after")
    def _either(self) -> "Motion":
        if (self.keyframes is None) == (self.recording is None):
            raise ValueError("must have either `keyframes` or a `recording`")
        return self

    @cached_property
    def movement(self) -> Movement:
        """The movement from the end of the preparation to the beginning of the retraction."""
        return self.recording or Keyframes(self.keyframes or [])


class Variant(Motion):
    """How a gesture is made in some emotions."""

    emotions: list[Label] = Field(min_length=1)


class Gesture(Motion):
    """A gesture of a bank.

    Attributes:
        triggers: Words and phrases that call it. Of two keywords whose gestures would overlap, the heavier
            one is made, and the first of two that weigh the same.
        cooldown: After a stroke, the same gesture is not made again for so long [s].
        mirrored: Whether the other hand may make it; see strokes.Strokes.
        variants: How it is made in some emotions. In any other, the emotion's tempo and amplitude change it.
    """

    triggers: list[Annotated[Trigger, BeforeValidator(_weighted)]] = Field(min_length=1)
    cooldown: float = Field(3.0, ge=0)
    mirrored: bool = False
    variants: list[Variant] = []

    def variant(self, emotion: str) -> Variant | None:
        """How it is made in an emotion, if that has a variant of its own."""
        return next((variant for variant in self.variants if emotion in variant.emotions), None)

    def weight(self, phrase: str) -> float:
        """The weight of a trigger; 1 for any other phrase."""
        return next((trigger.weight for trigger in self.triggers if trigger.phrase == phrase), 1.0)


class _Bank(Strict):
    poses: dict[str, ArmPose] = {}
    gestures: dict[str, Gesture] = {}

    @field_validator("poses")
    @classmethod
    def _share(cls, poses: dict[str, ArmPose], info: ValidationInfo) -> dict[str, ArmPose]:
        context(info)["poses"].update(poses)
        return poses


def load_banks(folder: str | Path = "shipped") -> dict[str, Gesture]:
    """Read every gesture of the *.yaml banks in a folder, or of those that ship.

    Raises:
        FileFormatError: See read_bank; or two gestures share a name or a trigger, or there is no bank.
    """
    banks = _bank_files(folder)
    if not banks:
        what = (
            "no semantic banks (*.yaml) in" if Path(folder).is_dir() else "semantic banks: there is no folder"
        )
        raise FileFormatError(what, str(folder))
    gestures: dict[str, Gesture] = {}
    callers: dict[str, str] = {}
    for path in banks:
        for name, gesture in read_bank(path).items():
            if name in gestures:
                place = yaml_place(path, ("gestures", name))
                raise FileFormatError(f"{path}: {place}: a gesture of this name is there already")
            gestures[name] = gesture
            for number, trigger in enumerate(gesture.triggers):
                if trigger.phrase in callers:
                    place = yaml_place(path, ("gestures", name, "triggers", number))
                    raise FileFormatError(
                        f"{path}: {place}: is a trigger of {callers[trigger.phrase]} already", trigger.phrase
                    )
                callers[trigger.phrase] = name
    return gestures


class WatchedBanks:
    """The banks of a folder, read again when a file among them changes.

    Args:
        folder: See load_banks.

    Attributes:
        gestures: Every gesture, as last read without a mistake.
    """

    def __init__(self, folder: str | Path = "shipped") -> None:
        self._folder = folder
        self._files = _fingerprint(folder)
        self.gestures = _read(folder, self._files)

    def changed(self) -> bool:
        """Look at the files; where one is new, changed or gone, read all again.

        Raises:
            FileFormatError: See load_banks. The gestures stay, and nothing is read until the next change.
        """
        files = _fingerprint(self._folder)
        if files == self._files:
            return False
        self._files = files
        self.gestures = _read(self._folder, files)
        return True


_Files = tuple[tuple[Path, int, int], ...]


@lru_cache(maxsize=2)
def _read(folder: str | Path, _files: _Files) -> dict[str, Gesture]:
    """The banks as these files are: the nodes of a process read them but once."""
    return load_banks(folder)


def _fingerprint(folder: str | Path) -> _Files:
    files = []
    for path in _bank_files(folder):
        with suppress(OSError):  # an editor has just moved it away
            files.append((path, path.stat().st_mtime_ns, path.stat().st_size))
    return tuple(files)


def _bank_files(folder: str | Path) -> list[Path]:
    return sorted((config_dir() / "banks" if folder == "shipped" else Path(folder)).glob("*.yaml"))


def read_bank(path: Path) -> dict[str, Gesture]:
    """Read the gestures of one bank. It may use the poses of config/banks/poses.yaml beside its own.

    Raises:
        FileFormatError: The bank does not fit; names file, line and key, and what is valid there.
    """
    return read_yaml(path, _Bank, {"poses": shared_poses(), "folder": path.parent}).gestures


def shared_poses() -> dict[str, ArmPose]:
    """The arm poses that every bank may use by name: config/banks/poses.yaml."""
    path = config_dir() / "banks" / "poses.yaml"
    return read_yaml(path, _Bank, {"poses": {}, "folder": path.parent}).poses


def triggers(gestures: Mapping[str, Gesture]) -> dict[str, str]:
    """The gesture that each word or phrase calls."""
    return {trigger.phrase: name for name, gesture in gestures.items() for trigger in gesture.triggers}
