"""Skeleton maps: what the joints, axes and file names of a data set mean (config/skeletons/*.yaml)."""

import os
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from gesture_bot.base.errors import FileFormatError, InvalidValueError
from gesture_bot.base.files import config_dir, read_yaml
from gesture_bot.base.keypoints import INDEX, KEYPOINTS
from gesture_bot.corpus.database import LABELS
from gesture_bot.corpus.sources import Take

NEEDED = (
    "neck",
    *(f"{side}_{part}" for side in ("left", "right") for part in ("shoulder", "elbow", "wrist")),
)
"""Keypoints that every source must have; the standard body fills in the others."""

SOUNDS = (".wav", ".flac", ".ogg")

Direction = Literal["forward", "backward", "left", "right", "up", "down"]

_REP_103 = {
    "forward": (1, 0, 0), "backward": (-1, 0, 0), "left": (0, 1, 0), "right": (0, -1, 0),
    "up": (0, 0, 1), "down": (0, 0, -1),
}  # fmt: skip

Joints = Annotated[
    tuple[str, ...], BeforeValidator(lambda value: value if isinstance(value, list | tuple) else (value,))
]


class SkeletonMap(BaseModel):
    """How to read the takes of one data set.

    Attributes:
        name: Of the map; its file's stem.
        description: The data set.
        joints: The source's joint of each keypoint; of several, their mean. Keypoints that are not here come
            from the standard body.
        axes: Where the source's x, y and z point, as the speaker sees it.
        joint_count: How many joints a take must have; for sources whose joints are numbers.
        rate: Frames a second, where the files do not say.
        file_name: Regular expression for file names without their ending. Its groups called emotion, style
            and speaker are labels; any group may be used in `sound`.
        sound: Name of the sound file without its ending, {GROUP} standing for what `file_name` found.
        codes: By kind of label, what a group means: a name or number, or numbers from A to B as `A-B`.
            What is not listed is no label. A kind without codes is taken as it is written.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, coerce_numbers_to_str=True)

    name: str = ""
    description: str
    joints: dict[str, Joints]
    axes: tuple[Direction, Direction, Direction]
    joint_count: int | None = None
    rate: float | None = Field(None, gt=0)
    file_name: str = ".*"
    sound: str | None = None
    codes: dict[Literal["emotion", "style", "speaker"], dict[str, str]] = {}

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if unknown := [name for name in self.joints if name not in KEYPOINTS]:
            raise ValueError(f"unknown keypoints {', '.join(unknown)}; valid: {', '.join(KEYPOINTS)}")
        if missing := [name for name in NEEDED if name not in self.joints]:
            raise ValueError(f"joints lacks {', '.join(missing)}")
        if np.linalg.matrix_rank(self._rotation()) < 3:
            raise ValueError("axes must name one each of forward or backward, left or right, up or down")
        try:
            groups = dict.fromkeys(re.compile(self.file_name).groupindex, "")
            (self.sound or "").format(**groups)
        except (re.error, LookupError, ValueError) as error:
            raise ValueError(f"file_name and sound do not fit together ({error})") from error
        return self

    def _rotation(self) -> np.ndarray:
        return np.array([_REP_103[direction] for direction in self.axes])

    def missing(self, joints: Sequence[str]) -> list[str]:
        """The joints that the map names and a source lacks."""
        return [joint for named in self.joints.values() for joint in named if joint not in joints]

    def fits(self, joints: Sequence[str]) -> bool:
        """Whether a source has all joints that the map names, and as many as it says."""
        return not self.missing(joints) and self.joint_count in (None, len(joints))

    def keypoints(self, take: Take) -> np.ndarray:
        """(n, 17, 3) keypoints in the source's units, x forward, y left, z up; NaN where the map has none.

        Raises:
            FileFormatError: The take lacks joints that the map names.
        """
        if missing := self.missing(take.joints):
            raise FileFormatError(
                f"the skeleton map {self.name} names joints that are not there: {', '.join(missing)}; "
                f"found: {', '.join(take.joints)}"
            )
        keypoints = np.full((len(take.positions), len(KEYPOINTS), 3), np.nan)
        for keypoint, names in self.joints.items():
            joints = [take.joints.index(name) for name in names]
            keypoints[:, INDEX[keypoint]] = take.positions[:, joints].mean(axis=1) @ self._rotation()
        return keypoints

    def labels(self, stem: str) -> dict[str, str]:
        """The labels that a file name holds, by kind."""
        match = re.fullmatch(self.file_name, stem)
        found = {kind: text for kind, text in (match.groupdict() if match else {}).items() if kind in LABELS}
        named = {
            kind: _decoded(self.codes[kind], text) if kind in self.codes else text
            for kind, text in found.items()
            if text
        }
        return {kind: name for kind, name in named.items() if name}

    def sound_stem(self, stem: str) -> str:
        """The name of the sound file that belongs to a file, both without their endings."""
        match = re.fullmatch(self.file_name, stem)
        return self.sound.format(**match.groupdict()) if self.sound and match else stem

    def sound_file(self, path: Path, sounds: Iterable[Path]) -> Path:
        """The sound of a file: of those with the right name, the one nearest to it in the folders.

        Raises:
            FileFormatError: There is none.
        """
        stem = self.sound_stem(path.stem)
        named = sorted(sound for sound in sounds if sound.stem == stem)
        if not named:
            endings = " or ".join(SOUNDS)
            raise FileFormatError(f"{path} has no sound: looked for {stem}{endings}")
        here = path.absolute().parent
        return max(named, key=lambda sound: len(os.path.commonpath([here, sound.absolute().parent])))


def _decoded(codes: Mapping[str, str], text: str) -> str | None:
    """What a code means, such as 70 in {"65-72": "happy"}; None where it is not listed."""
    for code, name in codes.items():
        first, dash, last = code.partition("-")
        if code == text or (dash and text.isdigit() and int(first) <= int(text) <= int(last)):
            return name
    return None


def load_skeletons() -> dict[str, SkeletonMap]:
    """The shipped maps, by name."""
    folder = config_dir() / "skeletons"
    return {path.stem: load_skeleton(str(path)) for path in sorted(folder.glob("*.yaml"))}


def load_skeleton(name: str) -> SkeletonMap:
    """A shipped map by its name, or one from a .yaml file.

    Raises:
        InvalidValueError: There is no such map.
        FileFormatError: The file does not fit.
    """
    if name.endswith((".yaml", ".yml")):
        return read_yaml(Path(name), SkeletonMap).model_copy(update={"name": Path(name).stem})
    shipped = load_skeletons()
    if name not in shipped:
        raise InvalidValueError("unknown skeleton map", name, [*shipped, "a .yaml file"])
    return shipped[name]


def choose_skeleton(take: Take, stem: str, skeletons: Sequence[SkeletonMap]) -> SkeletonMap:
    """The map that fits a take; of several, one that expects such a file name. A single one is not asked.

    Raises:
        FileFormatError: None fits.
    """
    if len(skeletons) == 1:
        return skeletons[0]
    fitting = [skeleton for skeleton in skeletons if skeleton.fits(take.joints)]
    if not fitting:
        raise FileFormatError(
            f"no skeleton map fits ({', '.join(skeleton.name for skeleton in skeletons)}); "
            f"its {len(take.joints)} joints: {', '.join(take.joints)}"
        )
    return max(fitting, key=lambda skeleton: re.fullmatch(skeleton.file_name, stem) is not None)
