"""Which stick moves which joint: config/joy.yaml, after teleop_twist_joy."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.files import config_dir, read_yaml
from gesture_bot.servo.jog import USED

SIDES: tuple[Literal["left", "right"], ...] = ("left", "right")

Index = Annotated[int, Field(ge=0, le=255)]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Axis(_Section):
    """A stick's axis; `reverse` turns its direction round."""

    axis: Index
    reverse: bool = False


class ButtonPair(_Section):
    """Two buttons that move a joint up and down."""

    plus: Index
    minus: Index


class Arm(_Section):
    """What moves an arm while `deadman` is held: its joints' controls, from the shoulder on."""

    deadman: Index
    joints: list[Axis | ButtonPair] = Field(min_length=1)


class Gamepad(_Section):
    """An assignment of axes and buttons, by their index in sensor_msgs/Joy.

    Attributes:
        stop: The button that stops.
        speed: Of a joint where its axis is at its end [share of the joint's velocity limit].
        dead_zone: An axis this close to its middle is in its middle.
        left_arm: What moves the left arm.
        right_arm: What moves the right arm.
    """

    stop: Index
    speed: float = Field(gt=0, le=USED)
    dead_zone: float = Field(ge=0, lt=1)
    left_arm: Arm
    right_arm: Arm

    @model_validator(mode="after")
    def _apart(self) -> "Gamepad":
        for side in SIDES:
            if self.arm(side).deadman == self.stop:
                raise ValueError(f"button {self.stop} is both `stop` and the deadman of the {side} arm")
        return self

    def arm(self, side: Literal["left", "right"]) -> Arm:
        """What moves an arm."""
        return self.left_arm if side == "left" else self.right_arm

    def stops(self, buttons: Sequence[int]) -> bool:
        """Whether the stop button is pressed.

        Raises:
            InvalidValueError: The pad has no such button.
        """
        return _button(buttons, self.stop)

    def holds(self, side: Literal["left", "right"], buttons: Sequence[int]) -> bool:
        """Whether an arm's deadman button is held.

        Raises:
            InvalidValueError: The pad has no such button.
        """
        return _button(buttons, self.arm(side).deadman)

    def velocities(
        self, side: Literal["left", "right"], axes: Sequence[float], buttons: Sequence[int], joints: int
    ) -> list[float]:
        """How fast the first joints of an arm are to move, as many as have a control.

        Args:
            side: Of the arm.
            axes: Of the pad, -1 to 1.
            buttons: Of the pad, 0 or 1.
            joints: How many the arm has.

        Returns:
            Shares of the joints' velocity limits.

        Raises:
            InvalidValueError: The pad lacks an axis or a button, or an axis is not a finite number.
        """
        return [self.speed * share for share in self._shares(self.arm(side).joints[:joints], axes, buttons)]

    def _shares(
        self, controls: Sequence[Axis | ButtonPair], axes: Sequence[float], buttons: Sequence[int]
    ) -> Iterator[float]:
        for control in controls:
            if isinstance(control, ButtonPair):
                yield float(_button(buttons, control.plus)) - float(_button(buttons, control.minus))
                continue
            value = _entry("axis", axes, control.axis)
            if not math.isfinite(value):
                raise InvalidValueError(f"axis {control.axis} of the gamepad is not a finite number", value)
            beyond = (min(abs(value), 1.0) - self.dead_zone) / (1.0 - self.dead_zone)
            yield math.copysign(max(beyond, 0.0), -value if control.reverse else value)


def load_gamepad(file: str = "shipped") -> Gamepad:
    """The assignment of a gamepad.

    Args:
        file: A YAML file, or "shipped".

    Raises:
        FileFormatError: It is missing or does not fit; names the line and what is valid there.
    """
    return read_yaml(config_dir() / "joy.yaml" if file == "shipped" else Path(file), Gamepad)


def _button(buttons: Sequence[int], index: int) -> bool:
    return bool(_entry("button", buttons, index))


def _entry(kind: str, values: Sequence[float], index: int) -> float:
    if index >= len(values):
        there = f"0 to {len(values) - 1}" if len(values) else "none"
        raise InvalidValueError(f"the gamepad lacks an assigned {kind}", index, [there])
    return values[index]
