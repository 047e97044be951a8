"""The joint that a virtual servo turns, without a body: a critically damped system, in closed form."""

import math
from typing import NamedTuple, Protocol

from gesture_bot.servo.models import RPM, Model


class Drive(NamedTuple):
    """What a servo's position controller tells its motor for a while.

    Attributes:
        begin: Where the motor is to be at first [ticks].
        end: Where it is to be in the end [ticks].
        stiffness: Share of the full voltage for an error of one tick.
        damping: Share of the full voltage against one tick a second.
        limit: Largest share of the full voltage.
    """

    begin: float
    end: float
    stiffness: float
    damping: float
    limit: float


class Joint(Protocol):
    """What turns when the motor does."""

    def move(
        self, position: float, velocity: float, drive: Drive | None, stuck: bool, seconds: float
    ) -> tuple[float, float, float]:
        """Let time pass.

        Args:
            position: Where the joint is [ticks]; somebody may have moved it since the last time.
            velocity: How fast it turns [ticks/s].
            drive: What the motor is told; None without torque.
            stuck: Whether the joint cannot turn.
            seconds: How much time [s].

        Returns:
            Position, velocity, and load as a share of the stall torque.
        """


class FirstOrderJoint:
    """A joint that stays where it is without torque, and follows the drive no faster than the no-load speed.

    Args:
        model: Whose joint it is.
        bandwidth: Its natural frequency [rad/s].
    """

    def __init__(self, model: Model, bandwidth: float):
        self._bandwidth = bandwidth
        self._fastest = model.speed * RPM * model.ticks_per_radian

    def move(
        self, position: float, velocity: float, drive: Drive | None, stuck: bool, seconds: float
    ) -> tuple[float, float, float]:
        """As `Joint.move`. The load is what the controller asks for."""
        if drive is None:
            return position, 0.0, 0.0
        if stuck:
            velocity = 0.0
        elif seconds:
            # A joint that follows a ramp is 2 / bandwidth behind it in the end.
            ramp = (drive.end - drive.begin) / seconds
            error = position - drive.begin + 2 * ramp / self._bandwidth
            pull = velocity - ramp + self._bandwidth * error
            decay = math.exp(-self._bandwidth * seconds)
            moved = ramp * seconds + (error + pull * seconds) * decay - error
            velocity = ramp + (pull - self._bandwidth * (error + pull * seconds)) * decay
            position += max(-self._fastest * seconds, min(self._fastest * seconds, moved))
            velocity = max(-self._fastest, min(self._fastest, velocity))
        return position, velocity, max(-1.0, min(1.0, drive.stiffness * (drive.end - position)))
