"""Joint trajectories as they arrive: checked, overlaid by their start, and left to coast where they end."""

from dataclasses import dataclass, replace

import numpy as np

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.fading import faded
from gesture_bot.base.trajectory import JointTrajectory

COASTING = 0.1
"""Time constant with which a joint comes to rest when nothing leads it any more [s]."""


def coast(
    position: np.ndarray, velocity: np.ndarray, elapsed: np.ndarray | float
) -> tuple[np.ndarray, np.ndarray]:
    """Position and velocity of joints left to themselves: the velocity decays exponentially.

    Args:
        position: Where they were left [rad].
        velocity: How fast they moved then [rad/s].
        elapsed: Time since then [s].
    """
    decay = np.exp(-np.maximum(elapsed, 0.0) / COASTING)
    return position + velocity * COASTING * (1.0 - decay), velocity * decay


def brake(
    position: np.ndarray, velocity: np.ndarray, elapsed: np.ndarray, deceleration: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Position and velocity of joints that come to rest evenly.

    Args:
        position: Where they were left [rad].
        velocity: How fast they moved then [rad/s].
        elapsed: Time since then [s].
        deceleration: How fast they brake [rad/s^2].
    """
    t = np.clip(elapsed, 0.0, np.abs(velocity) / deceleration)
    slowing = np.copysign(deceleration, velocity) * t
    return position + (velocity - 0.5 * slowing) * t, velocity - slowing


def easing_time(
    distance: np.ndarray, speed: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray
) -> np.ndarray:
    """How long `ease` needs [s], so that its own part of the motion stays below two limits.

    Args:
        distance: Between the two motions [rad].
        speed: Difference of their velocities [rad/s].
        velocity: Of which no more is used [rad/s].
        acceleration: Of which no more is used [rad/s^2].
    """
    # Peaks of the minimum-jerk weight: 1.875 / T in its first derivative, 5.774 / T^2 in its second.
    half = 1.875 * np.abs(speed) / acceleration
    by_acceleration = half + np.sqrt(half**2 + 5.774 * np.abs(distance) / acceleration)
    return np.maximum(by_acceleration, 1.875 * np.abs(distance) / velocity)


def ease(
    leaving: tuple[np.ndarray, np.ndarray],
    reaching: tuple[np.ndarray, np.ndarray],
    elapsed: np.ndarray | float,
    duration: np.ndarray | float,
) -> tuple[np.ndarray, np.ndarray]:
    """Pass from one motion over to another with a minimum-jerk weight.

    Args:
        leaving: Positions [rad] and velocities [rad/s] of the motion that is left.
        reaching: Those of the motion that takes over.
        elapsed: Time since the hand-over began [s].
        duration: How long it takes [s].
    """
    s = np.clip(elapsed / duration, 0.0, 1.0)
    weight = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    growth = 30.0 * (s * (1.0 - s)) ** 2 / duration
    position = leaving[0] + weight * (reaching[0] - leaving[0])
    velocity = leaving[1] + weight * (reaching[1] - leaving[1]) + growth * (reaching[0] - leaving[0])
    return position, velocity


def check_trajectory(trajectory: JointTrajectory, joints: tuple[str, ...]) -> None:
    """Refuse a trajectory that a robot cannot be asked to follow.

    Raises:
        InvalidValueError: It has no point, a joint that is not among `joints`, a number that is not finite,
            times that do not increase, or arrays that do not fit together.
    """
    for joint in trajectory.joints:
        if joint not in joints:
            raise InvalidValueError("the trajectory has an unknown joint", joint, joints)
    shape = (len(trajectory.times), len(trajectory.joints))
    if 0 in shape:
        raise InvalidValueError("the trajectory has no joint or no point: (points, joints)", shape)
    if len(set(trajectory.joints)) < len(trajectory.joints):
        raise InvalidValueError("the trajectory names a joint twice", trajectory.joints)
    for name, expected in (("times", shape[:1]), ("positions", shape), ("velocities", shape)):
        values = getattr(trajectory, name)
        if values.shape != expected:
            raise InvalidValueError(f"the trajectory's {name} have the wrong shape", values.shape, [expected])
        if not np.isfinite(values).all():
            bad = float(values[~np.isfinite(values)][0])
            raise InvalidValueError(f"the trajectory's {name} must be finite numbers", bad)
    steps = np.diff(trajectory.times)
    if (steps <= 0).any():
        raise InvalidValueError(
            "the trajectory's times must increase, but one step is [s]", float(steps.min())
        )


@dataclass(frozen=True)
class _Layer:
    """A trajectory, when it takes over [s], and where the plan before it was then, seen from it.

    That difference, in positions (j,) [rad] and velocities (j,) [rad/s], fades away with a half-life [s].
    """

    trajectory: JointTrajectory
    since: float
    position: np.ndarray
    velocity: np.ndarray
    half_life: float

    def at(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        trajectory = self.trajectory
        after = np.maximum(times - trajectory.times[-1], 0.0)[:, None]
        where, speed = trajectory.at(times)
        rest, slowing = coast(trajectory.positions[-1], trajectory.velocities[-1], after)
        elapsed = np.maximum(times - self.since, 0.0)[:, None]
        position, velocity = faded(self.position, self.velocity, elapsed, self.half_life)
        return np.where(after > 0, rest, where) + position, np.where(after > 0, slowing, speed) + velocity

    def without(self, joints: set[str]) -> "_Layer":
        """The layer but for some joints."""
        whole = self.trajectory
        kept = [i for i, joint in enumerate(whole.joints) if joint not in joints]
        if len(kept) == len(whole.joints):
            return self
        names = tuple(whole.joints[i] for i in kept)
        part = JointTrajectory(names, whole.times, whole.positions[:, kept], whole.velocities[:, kept])
        return _Layer(part, self.since, self.position[kept], self.velocity[kept], self.half_life)


class Overlay:
    """All that is planned for some joints: each trajectory replaces what it covers, from its first point on.

    A trajectory that goes on from the plan is followed exactly. One that departs from it, in position or
    velocity, is joined smoothly. A thread may ask for the plan while another one adds to it.

    Args:
        joints: The j joints.
        half_life: Of the difference where a trajectory departs from the plan [s].
    """

    def __init__(self, joints: tuple[str, ...], half_life: float):
        self.joints = joints
        self._half_life = half_life
        self._layers: list[_Layer] = []

    def add(self, trajectory: JointTrajectory, now: float) -> None:
        """Overlay a trajectory of some or all of the joints.

        Raises:
            InvalidValueError: It is not a trajectory for these joints. All stays as it was.
        """
        check_trajectory(trajectory, self.joints)
        layers = [*self._layers, self._joined(trajectory, max(trajectory.times[0], now))]
        shown = []
        for i, layer in enumerate(layers):
            # A later layer hides this one where it begins before it, or has begun by now.
            start = max(layer.trajectory.times[0], now)
            over = [later.trajectory for later in layers[i + 1 :] if later.trajectory.times[0] <= start]
            shown.append(layer.without({joint for later in over for joint in later.joints}))
        self._layers = [layer for layer in shown if layer.trajectory.joints]

    def forget(self, joints: set[str]) -> None:
        """Drop all that is planned for some joints."""
        layers = [layer.without(joints) for layer in self._layers]
        self._layers = [layer for layer in layers if layer.trajectory.joints]

    def at(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Where the plan leads: to its first point until it begins; after its last point the joint coasts.

        Args:
            times: (n,) [s since the epoch].

        Returns:
            (n, j) positions [rad] and (n, j) velocities [rad/s], NaN where nothing is planned.
        """
        positions = np.full((len(times), len(self.joints)), np.nan)
        velocities = positions.copy()
        for layer in self._layers:
            columns = self._columns(layer.trajectory)
            where, speed = layer.at(times)
            taken = (times >= layer.trajectory.times[0])[:, None] | np.isnan(positions[:, columns])
            positions[:, columns] = np.where(taken, where, positions[:, columns])
            velocities[:, columns] = np.where(taken, speed, velocities[:, columns])
        return positions, velocities

    def ends(self) -> np.ndarray:
        """(j,) when the plan of each joint ends [s since the epoch], -inf where there is none."""
        ends = np.full(len(self.joints), -np.inf)
        for layer in self._layers:
            ends[self._columns(layer.trajectory)] = layer.trajectory.times[-1]
        return ends

    def _joined(self, trajectory: JointTrajectory, since: float) -> _Layer:
        """A layer that takes over from the plan at a moment, in the middle of its motion."""
        columns, moment = self._columns(trajectory), np.array([since])
        still = np.zeros(len(columns))
        layer = _Layer(trajectory, since, still, still, self._half_life)
        (position, velocity), (asked, speed) = self.at(moment), layer.at(moment)
        return replace(
            layer,
            position=np.nan_to_num(position[0, columns] - asked[0]),
            velocity=np.nan_to_num(velocity[0, columns] - speed[0]),
        )

    def _columns(self, trajectory: JointTrajectory) -> list[int]:
        return [self.joints.index(joint) for joint in trajectory.joints]
