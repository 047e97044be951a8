"""Following a moving target without ever leaving position, velocity and acceleration limits.

Time runs in ticks of equal length, and the acceleration is constant within a tick. From velocity v, braking
as hard as allowed takes a distance D(v): the straight-line interpolation of v^2 / (2 a) between the
multiples of a dt, since the last tick brakes by less than a dt. A velocity is safe when D still fits before
the limit. Braking from a safe state leaves `position + D(velocity)` as it is, so that a safe velocity
exists at each later tick too.
"""

from dataclasses import dataclass

import numpy as np

from gesture_bot.base.errors import InvalidValueError

_FAR = 1e6
"""Distances are cut here [rad], so that absurd targets overflow nothing."""


@dataclass(frozen=True)
class JointLimits:
    """What the joints may do. All arrays are (j,).

    Attributes:
        joints: The j joint names.
        lower: Smallest position [rad].
        upper: Largest position [rad].
        velocity: Largest speed [rad/s].
        acceleration: Largest acceleration, either way [rad/s^2].
    """

    joints: tuple[str, ...]
    lower: np.ndarray
    upper: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray


class Follower:
    """Moves joints toward a moving target inside their limits, one tick at a time.

    A target that moves inside the limits is met without lag, and one at rest is reached in a finite number
    of ticks, without overshoot or chatter. Joints that start outside their position limits go back inside,
    never further out.

    Args:
        limits: The joints' limits.
        dt: Length of a tick [s].
        position: (j,) where the joints are [rad].
        velocity: (j,) how fast they move [rad/s]; None is at rest.

    Attributes:
        position: (j,) after the last tick [rad].
        velocity: (j,) after the last tick [rad/s].

    Raises:
        InvalidValueError: The position or velocity is not j finite numbers.
    """

    def __init__(
        self, limits: JointLimits, dt: float, position: np.ndarray, velocity: np.ndarray | None = None
    ):
        self.limits = limits
        self.dt = dt
        self._gain = limits.acceleration * dt
        self._unit = 0.5 * limits.acceleration * dt**2
        self.reset(position, velocity)

    def reset(self, position: np.ndarray, velocity: np.ndarray | None = None) -> None:
        """Start again from a position [rad] and velocity [rad/s], each (j,); velocity None is at rest."""
        velocity = np.zeros(len(self.limits.joints)) if velocity is None else velocity
        self.position = self._checked(position, "start position").copy()
        self.velocity = self._checked(velocity, "start velocity").copy()

    def step(self, target_position: np.ndarray, target_velocity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Move for one tick toward where the target is, and how fast it moves, at the tick's end.

        Args:
            target_position: (j,) [rad].
            target_velocity: (j,) [rad/s].

        Returns:
            The new (j,) position [rad] and (j,) velocity [rad/s].

        Raises:
            InvalidValueError: The target is not j finite numbers. Nothing has moved.
        """
        target_position = self._checked(target_position, "target position")
        target_velocity = self._checked(target_velocity, "target velocity")
        coasting = self.position + 0.5 * self.dt * self.velocity
        # Seen from the target, the law that stops at a limit stops at the target.
        target = target_position - 0.5 * self.dt * target_velocity
        lowest, highest, closing = self._fastest(
            np.array((self.limits.lower, self.limits.upper, target)) - coasting
        )
        lowest = np.maximum(lowest, -self.limits.velocity)
        highest = np.minimum(highest, self.limits.velocity)
        return self._move(np.minimum(np.maximum(target_velocity + closing, lowest), highest))

    def brake(self) -> tuple[np.ndarray, np.ndarray]:
        """Move for one tick, coming to rest as fast as the limits allow; returns as `step` does."""
        return self._move(np.zeros_like(self.velocity))

    def _move(self, wanted: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        velocity = np.minimum(np.maximum(wanted, self.velocity - self._gain), self.velocity + self._gain)
        moved = self.position + 0.5 * self.dt * (self.velocity + velocity)
        # Only rounding, or a start outside the limits, makes this differ from `moved`.
        lowest = np.minimum(self.limits.lower, self.position)
        highest = np.maximum(self.limits.upper, self.position)
        self.position = np.minimum(np.maximum(moved, lowest), highest)
        self.velocity = velocity
        return self.position.copy(), self.velocity.copy()

    def _fastest(self, distance: np.ndarray) -> np.ndarray:
        """The velocity u at a tick's end from which braking stops just in time: `dt u / 2 + D(u) = distance`.

        `distance` is counted from where the joint would be if its velocity fell to zero evenly within the
        tick. Counting u in a dt and the distance in a dt^2 / 2, the left side is k (k + 1) at u = k, and
        straight between.
        """
        units = np.minimum(np.abs(distance), _FAR) / self._unit
        k = np.floor(np.sqrt(units + 0.25) - 0.5)
        return np.copysign(0.5 * self._gain * (k + units / (k + 1.0)), distance)

    def _checked(self, value: np.ndarray, name: str) -> np.ndarray:
        value = np.asarray(value, float)
        if value.shape != (len(self.limits.joints),) or not np.isfinite(value).all():
            message = f"the {name} must be {len(self.limits.joints)} finite numbers, one a joint"
            raise InvalidValueError(message, value.tolist())
        return value
