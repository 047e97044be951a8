"""Emotions: the labels of hri_msgs/Expression, and what each does to the motion and to the voice."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, RootModel, field_validator

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.files import config_dir, read_yaml
from gesture_bot.matching.controls import Constraint
from gesture_bot.matching.expressions import LABELS, Label
from gesture_bot.matching.shaping import AMPLITUDE, TEMPO
from gesture_bot.speech.voice import PLAIN, Manner

Coordinate = Annotated[float, Field(ge=-1, le=1, allow_inf_nan=False)]


@dataclass(frozen=True)
class Emotion:
    """How an emotion moves and speaks.

    Attributes:
        name: Label of hri_msgs/Expression.
        valence: From -1, unpleasant, to 1, pleasant.
        arousal: From -1, calm, to 1, agitated.
        labels: Emotions of the database whose motion suits it.
        constraints: Controls that bring it out in any motion.
        tempo: How fast it makes gestures of the banks, and recorded motion of other emotions; 1 as it is.
        amplitude: How far it makes the hands go from rest in these; 1 as they do.
        voice: The manner in which it speaks.
    """

    name: str
    valence: float
    arousal: float
    labels: tuple[str, ...]
    constraints: tuple[Constraint, ...]
    tempo: float
    amplitude: float
    voice: Manner = PLAIN


NEUTRAL = {"neutral": Emotion("neutral", 0.0, 0.0, (), (), 1.0, 1.0)}
"""The emotion that changes nothing and leaves all motion of a database, for those who measure."""


class _Entry(BaseModel):
    model_config = ConfigDict(extra="forbid")

    valence: Coordinate
    arousal: Coordinate
    labels: tuple[Label, ...]
    constraints: tuple[Constraint, ...] = ()
    tempo: float = Field(1.0, ge=TEMPO[0], le=TEMPO[1])
    amplitude: float = Field(1.0, ge=AMPLITUDE[0], le=AMPLITUDE[1])
    voice: Manner = PLAIN


class _File(RootModel[dict[Label, _Entry]]):
    @field_validator("root")
    @classmethod
    def _complete(cls, entries: dict[Label, _Entry]) -> dict[Label, _Entry]:
        missing = [label for label in LABELS if label not in entries]
        if missing:
            raise ValueError(f"these emotions are missing: {', '.join(missing)}")
        return entries


def load_emotions(path: Path | None = None) -> dict[str, Emotion]:
    """Read every emotion from a file like config/emotions.yaml, which is the default.

    Raises:
        FileFormatError: The file does not fit; names the key and what is valid there.
    """
    entries = read_yaml(path or config_dir() / "emotions.yaml", _File).root
    return {name: Emotion(name, **dict(entry)) for name, entry in entries.items()}


def find_emotion(emotions: Mapping[str, Emotion], label: str, valence: float, arousal: float) -> Emotion:
    """The emotion that a hri_msgs/Expression means: its label or, where that is empty, the nearest one.

    Raises:
        InvalidValueError: The label is unknown; or it is empty, and valence or arousal is not from -1 to 1.
    """
    if label:
        if label not in emotions:
            raise InvalidValueError("unknown emotion", label, emotions)
        return emotions[label]
    for name, number in (("valence", valence), ("arousal", arousal)):
        if not -1 <= number <= 1:
            raise InvalidValueError(f"{name} of an emotion", number, ["-1 to 1"])
    return min(emotions.values(), key=lambda e: math.hypot(e.valence - valence, e.arousal - arousal))
