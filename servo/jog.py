"""An operator's joints: moved by velocities or to angles, from where they are, inside the limits."""

from collections.abc import Iterable, Mapping
from copy import copy
from dataclasses import replace

import numpy as np

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.trajectory import JointTrajectory
from gesture_bot.retarget.follower import Follower, JointLimits

PERIOD = 0.04
"""Time from one tick to the next [s]."""

USED = 0.6
"""Share of a joint's limits that an operator uses; the rest is for passing from one owner to the next."""

GOING = 0.25
"""Share of a joint's velocity limit with which it goes to an angle."""

HELD_ON = 4
"""So many ticks the motion goes on when the next trajectory does not come; then it brakes."""

LEASH = 0.4
"""What is asked of a joint goes no farther from where the joint is [rad], and slower from half of it on. So a
joint that was stopped, or blocked, or kept off another link, does not leap when it comes free."""


class Jog:
    """Moves the joints that an operator has taken; all others are not in its trajectories.

    Args:
        limits: The j joints, and what they may do.

    Attributes:
        joints: The j joint names.
    """

    def __init__(self, limits: JointLimits):
        self.joints = limits.joints
        self._limits = limits
        start = np.clip(0.0, limits.lower, limits.upper)
        self._follower = Follower(replace(limits, acceleration=USED * limits.acceleration), PERIOD, start)
        self._taken = np.zeros(len(limits.joints), bool)
        self._velocity = np.zeros(len(limits.joints))
        self._goal = np.full(len(limits.joints), np.nan)
        self._time = -np.inf

    @property
    def taken(self) -> tuple[str, ...]:
        """The joints that are the operator's."""
        return tuple(joint for joint, taken in zip(self.joints, self._taken, strict=True) if taken)

    @property
    def goals(self) -> np.ndarray:
        """(j,) where the joints are sent, or else where they are asked to be now [rad]; NaN if not taken."""
        goals = np.where(np.isnan(self._goal), self._follower.position, self._goal)
        return np.where(self._taken, goals, np.nan)

    def take(self, joints: Iterable[str], measured: np.ndarray) -> None:
        """Take joints where they are, at rest; those taken already go on.

        Args:
            joints: Their names.
            measured: (j,) where all joints are [rad]; NaN where that is not known.

        Raises:
            InvalidValueError: A joint is unknown, or it is not known where it is. Nothing changes.
        """
        new = self._mask(joints) & ~self._taken
        if np.isnan(measured[new]).any():
            lost = [joint for joint, i in zip(self.joints, new & np.isnan(measured), strict=True) if i]
            raise InvalidValueError("no joint state tells where a joint is", ", ".join(lost))
        inside = np.clip(measured, self._limits.lower, self._limits.upper)
        follower = self._follower
        follower.reset(np.where(new, inside, follower.position), np.where(new, 0.0, follower.velocity))
        self._velocity = np.where(new, 0.0, self._velocity)
        self._goal = np.where(new, np.nan, self._goal)
        self._taken |= new

    def give_back(self, joints: Iterable[str]) -> None:
        """Leave joints to others.

        Raises:
            InvalidValueError: A joint is unknown. Nothing changes.
        """
        self._taken &= ~self._mask(joints)

    def move(self, velocities: Mapping[str, float]) -> None:
        """Move taken joints at velocities, until told otherwise [share of the joint's limit, -1 to 1].

        Raises:
            InvalidValueError: A joint is unknown or not taken. Nothing changes.
        """
        self._set(velocities, self._velocity)
        self._goal[self._mask(velocities)] = np.nan

    def go(self, angles: Mapping[str, float]) -> None:
        """Send taken joints to angles [rad]; one beyond a limit means the limit.

        Raises:
            InvalidValueError: A joint is unknown or not taken. Nothing changes.
        """
        self._set(angles, self._goal)
        self._goal = np.clip(self._goal, self._limits.lower, self._limits.upper)

    def tick(self, now: float, measured: np.ndarray) -> JointTrajectory | None:
        """The motion of the taken joints from a period ahead on, until they rest; None where none is taken.

        To be called every PERIOD. A tick that comes late is not made up for.

        Args:
            now: [s since the epoch].
            measured: (j,) where all joints are [rad]; one that is not known, NaN, brakes.
        """
        if not self._taken.any():
            return None
        following = self._time + PERIOD
        self._time = following if abs(following - now - PERIOD) < PERIOD else now + PERIOD
        self._step(self._follower, measured)
        ahead = copy(self._follower)
        states = [(ahead.position, ahead.velocity)]
        for _ in range(HELD_ON):
            states.append(self._step(ahead, measured))
        while ahead.velocity.any():
            states.append(ahead.brake())
        positions, velocities = (np.array(values)[:, self._taken] for values in zip(*states, strict=True))
        return JointTrajectory(
            self.taken, self._time + PERIOD * np.arange(len(states)), positions, velocities
        )

    def _step(self, follower: Follower, measured: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Move a follower for one tick as the operator wants."""
        pushed = np.isnan(self._goal)
        speed = np.where(pushed, self._velocity * self._limits.velocity, 0.0)
        # Coasting to rest leads half a tick ahead; half a tick of a velocity more leads to that velocity.
        pushing = follower.position + 0.5 * PERIOD * (follower.velocity + speed)
        target = np.where(pushed, pushing, self._goal)
        lead = follower.position - measured
        returning = lead * (target - follower.position) < 0
        free = np.nan_to_num(np.clip(2.0 * (1.0 - np.abs(lead) / LEASH), 0.0, 1.0))
        share = np.minimum(np.where(pushed, USED, GOING), USED * np.where(returning, 1.0, free)) * self._taken
        follower.limits = replace(follower.limits, velocity=share * self._limits.velocity)
        return follower.step(target, speed)

    def _set(self, values: Mapping[str, float], into: np.ndarray) -> None:
        for joint in values:
            if joint not in self.taken:
                raise InvalidValueError("the operator has not taken the joint", joint, self.taken)
        for joint, value in values.items():
            into[self.joints.index(joint)] = value

    def _mask(self, joints: Iterable[str]) -> np.ndarray:
        joints = tuple(joints)
        for joint in joints:
            if joint not in self.joints:
                raise InvalidValueError("unknown joint", joint, self.joints)
        return np.isin(self.joints, joints)
