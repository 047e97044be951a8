"""Gestures as spans of a recording: a person's own movement, cut out of a file."""

from functools import cached_property
from pathlib import Path
from typing import Self

import numpy as np
from pydantic import Field, PrivateAttr, ValidationInfo, model_validator
from scipy.interpolate import CubicSpline

from gesture_bot.base.errors import FileFormatError, GestureBotError
from gesture_bot.base.frames import FRAME_RATE
from gesture_bot.matching.arms import Arm, Side, reach
from gesture_bot.matching.poses import Strict, context


class Span(Strict):
    """What both arms do in a part of a recording; the head is left as it is.

    Attributes:
        file: The recording, relative to the bank's folder, of a kind that corpus.readers knows.
        map: The map of its skeleton; see corpus.skeletons.load_skeleton.
        start, end, stroke: Where the span begins and ends, and its stroke [s from the recording's start];
            in the bank `from`, `to` and `stroke`.
    """

    file: str
    map: str = "gesture_bot"
    start: float = Field(alias="from", ge=0)
    end: float = Field(alias="to")
    stroke: float
    _motion: CubicSpline = PrivateAttr()

    @model_validator(mode="after")
    def _read(self, info: ValidationInfo) -> Self:
        if not self.start <= self.stroke <= self.end or self.start == self.end:
            raise ValueError(
                f"the stroke, {self.stroke} s, must lie in the span, from {self.start} to {self.end} s"
            )
        try:
            self._motion = _motion(context(info)["folder"] / self.file, self.map, self.start, self.end)
        except GestureBotError as error:
            raise ValueError(str(error)) from error
        return self

    @property
    def first(self) -> float:
        """When the span begins, from the stroke [s]."""
        return self.start - self.stroke

    @property
    def last(self) -> float:
        """When it ends [s]."""
        return self.end - self.stroke

    @cached_property
    def moments(self) -> np.ndarray:
        """(n,) when it is worth a look [s]: evenly from its beginning to its end, and the stroke."""
        return np.unique([*np.linspace(self.first, self.last, 7), 0.0])

    def arm(self, side: Side, times: np.ndarray, body: np.ndarray) -> Arm:
        """One arm of a body (17, 3) at (n,) moments from the stroke [s]."""
        keypoints = self._motion(np.clip(times + self.stroke, self.start, self.end))
        arm = Arm.of(keypoints, side)
        return Arm(
            arm.wrist * reach(body, side) / reach(keypoints[0], side), arm.elbow, arm.fingers, arm.palm
        )

    def head(self, times: np.ndarray) -> np.ndarray:
        """(n, 3) zeros: the head is not turned."""
        return np.zeros((len(times), 3))


def _motion(path: Path, skeleton: str, start: float, end: float) -> CubicSpline:
    """The keypoints (17, 3) [m] of a file's first take, by the time in it [s].

    Raises:
        GestureBotError: The file or the map is missing, is damaged or does not fit, or the speaker is not to
            be seen from start to end.
    """
    # Most banks hold no recordings, and are read without what reads those.
    from gesture_bot.corpus.readers import reader_of
    from gesture_bot.corpus.skeletons import load_skeleton
    from gesture_bot.corpus.takes import motion_of

    take = next(iter(reader_of(path).read(path)))
    motion = motion_of(take, load_skeleton(skeleton))
    seen = [(kept.start / motion.rate, (kept.stop - 1) / motion.rate) for kept in motion.kept]
    if not any(first <= start and end <= last for first, last in seen):
        raise FileFormatError(
            f"{path} does not show the speaker from {start} to {end} s",
            valid=[f"{first:.2f} to {last:.2f} s" for first, last in seen],
        )
    return CubicSpline(np.arange(len(motion.keypoints)) / FRAME_RATE, motion.keypoints)
