"""What a robot's YAML file says: the mapping from people, the servo table, the bus."""

import math
from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, FiniteFloat, PositiveFloat, model_validator


def _unit(axis: tuple[float, float, float]) -> tuple[float, float, float]:
    if abs(np.linalg.norm(axis) - 1.0) > 1e-3:
        raise ValueError("an axis must be a unit vector")
    return axis


Axis = Annotated[tuple[FiniteFloat, FiniteFloat, FiniteFloat], AfterValidator(_unit)]
"""A direction in a link's own frame."""


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Arm(_Section):
    """Links that stand for one human arm.

    The upper arm points from the origin of `shoulder` to that of `elbow`, the forearm from there to that of
    `wrist`, or to the point `wrist_at` [m] in its frame where no link begins at the wrist. `palm` points out
    of the palm, in the frame of `hand`.
    """

    shoulder: str
    elbow: str
    wrist: str
    hand: str
    palm: Axis
    wrist_at: tuple[FiniteFloat, FiniteFloat, FiniteFloat] = (0.0, 0.0, 0.0)


class Head(_Section):
    """The link that turns with the head, and the axis along which its face looks."""

    link: str
    forward: Axis


class Mapping(_Section):
    """Links that stand for the human body. `forward` and `up` are the torso's, in the frame of its link."""

    torso: str
    forward: Axis = (1.0, 0.0, 0.0)
    up: Axis = (0.0, 0.0, 1.0)
    left_arm: Arm
    right_arm: Arm
    head: Head

    def links(self) -> tuple[str, ...]:
        """Every link named."""
        arms = (self.left_arm, self.right_arm)
        return (
            self.torso,
            self.head.link,
            *(link for arm in arms for link in (arm.shoulder, arm.elbow, arm.wrist, arm.hand)),
        )

    def torso_axes(self) -> np.ndarray:
        """(3, 3) columns: forward, left and up, in the frame of the torso's link."""
        left = np.cross(self.up, self.forward)
        return np.stack([self.forward, left, np.cross(self.forward, left)], axis=1)

    @model_validator(mode="after")
    def _torso_is_upright(self) -> "Mapping":
        if abs(np.dot(self.forward, self.up)) > 1e-2:
            raise ValueError("the torso's forward and up are not at right angles")
        return self


class Joint(_Section):
    """A joint and its servo: servo angle = direction * joint angle + offset.

    Attributes:
        id: Dynamixel ID, another one for each servo.
        bus: Name of the bus that the servo is on, where the robot has several serial ports.
        model: Dynamixel model name, such as XM430-W350.
        direction: +1 or -1.
        offset: Servo angle, from the middle of its range, at which the joint is at zero [rad].
        rest: Angle of the rest pose [rad].
        acceleration: Largest acceleration [rad/s^2]. URDF has no place for it.
        lower: Narrows the URDF's lower limit, or stands for one that it lacks [rad].
        upper: Narrows the URDF's upper limit, or stands for one that it lacks [rad].
        velocity: Narrows the URDF's velocity limit, or stands for one that it lacks [rad/s].
        mark: Where the joint stands when it is calibrated [rad]; if not given, at zero, or at its limit next
            to zero.
    """

    id: int = Field(ge=0, le=252)
    model: str
    direction: Literal[1, -1]
    offset: FiniteFloat
    rest: FiniteFloat
    acceleration: Annotated[PositiveFloat, Field(allow_inf_nan=False)]
    lower: FiniteFloat = -math.inf
    upper: FiniteFloat = math.inf
    velocity: PositiveFloat = math.inf
    mark: FiniteFloat | None = None
    bus: str = Field("", pattern=r"^\w+$")


class Bus(_Section):
    """The servo bus.

    Attributes:
        baudrate: [bit/s].
        protocol: Dynamixel protocol version, 2.0.
        lag_ms: How far servos are behind their goals [ms]; goals are sent so much earlier.
        watchdog_ms: Silence after which a servo stops by itself [ms]. The register counts units of 20 ms.
        warm_degc: From this temperature on a servo slows, down to 30% of its speed where it is hot [degC].
        hot_degc: A servo this hot goes to rest and off, until it is no longer warm [degC].
        on_fault: What the rest of the robot does while a servo is hot, reports an error or does not answer.
        on_stop: What the joints do on a stop once they stand: hold, or relax, so that a hand can move them.
            Relaxed arms fall.
        on_exit: What becomes of the motors: they go to rest and switch off, hold, or switch off at once.
    """

    baudrate: int = Field(gt=0)
    protocol: float = Field(ge=2.0, le=2.0)
    lag_ms: float = Field(0.0, ge=0, le=100)
    watchdog_ms: int = Field(ge=20, le=2540, multiple_of=20)
    warm_degc: float = Field(default=60.0, gt=0, le=100)
    hot_degc: float = Field(default=68.0, gt=0, le=100)
    on_fault: Literal["stop", "carry_on"] = "stop"
    on_stop: Literal["hold", "relax"] = "hold"
    on_exit: Literal["rest_then_off", "hold", "off"]

    @model_validator(mode="after")
    def _warm_before_hot(self) -> "Bus":
        if self.warm_degc >= self.hot_degc:
            raise ValueError(f"warm_degc {self.warm_degc:g} must be below hot_degc {self.hot_degc:g}")
        return self


class RobotDescription(_Section):
    """The whole file. `urdf` is relative to its folder; `joints` is the servo table, in its order."""

    urdf: str
    mapping: Mapping
    joints: dict[str, Joint] = Field(min_length=1)
    bus: Bus

    @model_validator(mode="after")
    def _ids_differ(self) -> "RobotDescription":
        ids = [joint.id for joint in self.joints.values()]
        doubled = sorted({number for number in ids if ids.count(number) > 1})
        if doubled:
            names = " and ".join(name for name, joint in self.joints.items() if joint.id == doubled[0])
            raise ValueError(
                f"joints share the servo id {doubled[0]}, {names}: ids differ, also on several buses"
            )
        return self

    @model_validator(mode="after")
    def _all_or_no_buses_are_named(self) -> "RobotDescription":
        without = [name for name, joint in self.joints.items() if not joint.bus]
        if without and len(without) < len(self.joints):
            raise ValueError(f"{without[0]} names no bus, as other joints do")
        return self
