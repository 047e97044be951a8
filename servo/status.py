"""What the driver tells of the servos and of itself."""

import math
from dataclasses import dataclass, field

import numpy as np

from gesture_bot.servo.envelope import Interventions
from gesture_bot.servo.health import Health


@dataclass(frozen=True)
class Feedback:
    """What the servos tell.

    Attributes:
        positions: (j,) [rad].
        velocities: (j,) [rad/s].
        efforts: (j,) [N m], from the motor current or load and the stall torque of the model.
        planned: (j,) where they were to be now [rad]; NaN where nothing is planned, or the robot holds.
        stamp: When they were asked [s since the epoch].
        prompt: Whether all in service answered, so soon that they measured within 4 ms of it.
    """

    positions: np.ndarray
    velocities: np.ndarray
    efforts: np.ndarray
    planned: np.ndarray
    stamp: float
    prompt: bool


@dataclass
class Status:
    """Counts and states since the start, for diagnostics.

    Attributes:
        cycles: Ticks.
        late_cycles: Ticks that came more than half a period late.
        late_answers: Ticks that waited for the servos so long that it is not known when they measured.
        read_failures: Answers that did not come in time or were damaged.
        watchdog_stops: How often the watchdogs had to be armed anew, since the ticks had paused too long.
        silent: Joints whose servo does not answer.
        out: Joints that are out of service, and why; silent ones are among them.
        warm: Joints that are slowed, or at rest, since their servo is warm or hot.
        yielding: Joints that were blocked or pushed away, and yield.
        kept_off: Joints that have been held for a while, so that the robot does not touch itself.
        blocks: How often a joint has begun to yield.
        holding: Whether all joints hold: since one is out of service, or hot; on a stop; or while nothing is
            to be followed.
        relaxed: Whether torque is off, or not yet on again, on a stop.
        ports_lost: How often the port has vanished.
        latency_timer: How long the USB adapter keeps answers back [ms], where it has such a timer.
        command_age: Time since the last new trajectory [s]; inf before the first.
        interventions: What the envelope held back.
        health: Health by joint, each looked at in turn.
    """

    cycles: int = 0
    late_cycles: int = 0
    late_answers: int = 0
    read_failures: int = 0
    watchdog_stops: int = 0
    silent: tuple[str, ...] = ()
    out: dict[str, str] = field(default_factory=dict)
    warm: tuple[str, ...] = ()
    yielding: tuple[str, ...] = ()
    kept_off: tuple[str, ...] = ()
    blocks: int = 0
    holding: bool = False
    relaxed: bool = False
    ports_lost: int = 0
    latency_timer: int | None = None
    command_age: float = math.inf
    interventions: Interventions = field(default_factory=Interventions)
    health: dict[str, Health] = field(default_factory=dict)
