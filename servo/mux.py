"""Who has control: sources by their priority, joint by joint, with smooth hand-over and a latched stop."""

from collections.abc import Iterable

import numpy as np

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.trajectory import JointTrajectory
from gesture_bot.retarget.follower import JointLimits
from gesture_bot.servo.arbitration import NOBODY, STOP, Lock, Source
from gesture_bot.servo.trajectories import Overlay, brake, ease, easing_time

BLEND = 0.6
"""A joint takes at least so long to pass from one owner to the next [s]."""

SHARE = 0.4
"""Share of a joint's limits that passing from one owner to the next uses; the rest is for their motions."""

BRAKING = 0.9
"""Share of the acceleration limit with which a stop brakes."""

SET_BACK = 1.0
"""A clock that goes back by more was set anew [s]."""

HORIZON = np.linspace(0.0, 0.3, 7)
"""Moments of the points put out, from now on [s]: the robot moves on evenly when the next ones come late.
Behind them comes a last one at rest, for the case that none come: joint_trajectory_controller asks for it."""

SHORTEST_REST = 0.05
"""The last point is at least so long behind the horizon [s]."""

HALF_LIFE = 0.3
"""Half-life of the difference where a source departs from its own plan [s]. A target 1 rad away is approached
with at most 1.7 rad/s and 21 rad/s^2."""


class MotionMux:
    """Merges the trajectories of several sources into one.

    A joint that nobody owns brakes and stays. While stopped, none has an owner.

    Args:
        limits: The j joints, and what they may do.
        positions: (j,) where they are at the start [rad].
        sources: Who may ask for motion.
        locks: What masks them. One with a timeout is engaged until it is heard.

    Attributes:
        joints: The j joints.
        stopped: True from `stop` to `reset`.
    """

    def __init__(
        self,
        limits: JointLimits,
        positions: np.ndarray,
        sources: Iterable[Source],
        locks: Iterable[Lock] = (),
    ):
        self.joints = joints = limits.joints
        self._limits = limits
        self.stopped = False
        self._locks = {lock.name: lock for lock in locks}
        self._lock_heard = {lock.name: (False, -np.inf) for lock in locks}
        self._sources = sorted(sources, key=lambda source: source.priority)
        self._plans = {source.name: Overlay(joints, HALF_LIFE) for source in self._sources}
        self._heard = {source.name: np.full(len(joints), -np.inf) for source in self._sources}
        self._owner = np.full(len(joints), NOBODY, object)
        # Each joint leaves the motion it had when its owner changed.
        self._changed = np.full(len(joints), -np.inf)
        self._left_position = np.array(positions, float)
        self._left_velocity = np.zeros(len(joints))
        self._blend = np.full(len(joints), BLEND)
        self._ticked = -np.inf

    @property
    def owners(self) -> dict[str, str]:
        """Who owns each joint: a source's name, `nobody`, or `stop`."""
        return dict(zip(self.joints, self._owner, strict=True))

    def set_source(self, name: str, trajectory: JointTrajectory, now: float) -> None:
        """Take a source's trajectory for some or all of the joints.

        Raises:
            InvalidValueError: The source is unknown, or the trajectory not for these joints. Nothing changes.
        """
        if name not in self._plans:
            raise InvalidValueError("unknown source of motion", name, self._plans)
        self._plans[name].add(trajectory, now)
        self._heard[name][np.isin(self.joints, trajectory.joints)] = now

    def set_lock(self, name: str, engaged: bool, now: float) -> None:
        """Engage a lock, or release it.

        Raises:
            InvalidValueError: It is unknown.
        """
        if name not in self._locks:
            raise InvalidValueError("unknown lock", name, self._locks)
        self._lock_heard[name] = engaged, now

    def locks(self, now: float) -> list[Lock]:
        """The locks that are engaged, also for want of a word from their publisher."""
        return [
            lock
            for lock, (engaged, heard) in zip(self._locks.values(), self._lock_heard.values(), strict=True)
            if engaged or now - heard > lock.timeout
        ]

    def stop(self) -> None:
        """Let all joints brake and hold, whoever asks for motion, until `reset`."""
        self.stopped = True

    def reset(self) -> None:
        """Let the sources move the joints again. What they asked for until now is void."""
        self.stopped = False
        self._forget_all()

    def tick(self, now: float) -> JointTrajectory:
        """Motion of all joints for the next 0.3 s, and a last point at which they have come to rest."""
        if now < self._ticked - SET_BACK:
            self._start_over(now)
        self._ticked = now
        owner = self._next_owner(now)
        changed = owner != self._owner
        if changed.any():
            positions, velocities = self._command(np.array([now]))
            self._left_position = np.where(changed, positions[0], self._left_position)
            self._left_velocity = np.where(changed, velocities[0], self._left_velocity)
            self._changed = np.where(changed, now, self._changed)
            self._owner = owner
            asked, speeds = self._asked(np.array([now]))
            distance = np.nan_to_num(asked[0] - self._left_position)
            speed = np.nan_to_num(speeds[0] - self._left_velocity)
            limits = SHARE * self._limits.velocity, SHARE * self._limits.acceleration
            blend = np.maximum(easing_time(distance, speed, *limits), BLEND)
            self._blend = np.where(changed, blend, self._blend)
        self._forget_lapsed(now)
        return self._until_rest(now + HORIZON)

    def _start_over(self, now: float) -> None:
        """The clock was set back: what is planned is void, and all joints brake where they were."""
        where, speed = self._command(np.array([self._ticked]))
        self._left_position, self._left_velocity = where[0], speed[0]
        self._changed[:], self._owner[:] = now, NOBODY
        self._forget_all()
        self._lock_heard = {name: (engaged, now) for name, (engaged, _) in self._lock_heard.items()}

    def _lapsed(self, source: Source, now: float) -> np.ndarray:
        """(j,) whether the source asks for the joint no more."""
        ended = self._plans[source.name].ends() < now
        return ended & (now - self._heard[source.name] >= source.timeout)

    def _next_owner(self, now: float) -> np.ndarray:
        if self.stopped:
            return np.full(len(self.joints), STOP, object)
        owner = np.full(len(self.joints), NOBODY, object)
        masked = max((lock.priority for lock in self.locks(now)), default=-1)
        for source in self._sources:
            if source.priority > masked:
                planned = self._plans[source.name].ends() > -np.inf
                owner[planned & ~self._lapsed(source, now)] = source.name
        return owner

    def _forget_lapsed(self, now: float) -> None:
        """Drop what lapsed, so that a source that comes back later does not begin where it once ended."""
        for source in self._sources:
            lapsed = self._lapsed(source, now)
            self._plans[source.name].forget(
                {joint for joint, gone in zip(self.joints, lapsed, strict=True) if gone}
            )

    def _forget_all(self) -> None:
        for name, plan in self._plans.items():
            plan.forget(set(self.joints))
            self._heard[name][:] = -np.inf

    def _asked(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(n, j) positions [rad] and velocities [rad/s] that the owners plan; NaN where there is none."""
        positions = np.full((len(times), len(self.joints)), np.nan)
        velocities = positions.copy()
        for name, plan in self._plans.items():
            own = self._owner == name
            if own.any():
                where, speed = plan.at(times)
                positions[:, own], velocities[:, own] = where[:, own], speed[:, own]
        return positions, velocities

    def _command(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(n, j) positions [rad] and velocities [rad/s] under the present owners."""
        elapsed = times[:, None] - self._changed
        share = np.where(self._owner == STOP, BRAKING, SHARE)
        leaving = brake(self._left_position, self._left_velocity, elapsed, share * self._limits.acceleration)
        asked = self._asked(times)
        eased = ease(leaving, asked, elapsed, self._blend)
        owned = ~np.isnan(asked[0])
        return np.where(owned, eased[0], leaving[0]), np.where(owned, eased[1], leaving[1])

    def _until_rest(self, times: np.ndarray) -> JointTrajectory:
        """The motion at (n,) times [s], and one point more: all joints brake evenly and stand together."""
        positions, velocities = self._command(times)
        leaving, speeds, limits = positions[-1], velocities[-1], self._limits
        braking = max(float(np.max(np.abs(speeds) / (BRAKING * limits.acceleration))), SHORTEST_REST)
        # The cubic from here to there is the parabola of even braking; at a limit the joint stops short.
        lower, upper = np.minimum(limits.lower, leaving), np.maximum(limits.upper, leaving)
        rest = np.clip(leaving + 0.5 * braking * speeds, lower, upper)
        return JointTrajectory(
            self.joints,
            np.append(times, times[-1] + braking),
            np.vstack([positions, rest]),
            np.vstack([velocities, np.zeros_like(rest)]),
        )
