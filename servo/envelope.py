"""The safety envelope: the last step before the bus, which no motion leaves, whoever asks for it."""

from collections import deque
from dataclasses import dataclass, replace

import numpy as np

from gesture_bot.retarget.follower import Follower, JointLimits
from gesture_bot.servo.collision_guard import CollisionGuard

EASING_VELOCITY = 0.5
"""Largest speed of a joint until it has met its target for the first time [rad/s]."""

MET = 0.02
"""A joint this close to its target has met it [rad]."""

HELD_BACK = 1e-3
"""A joint this far behind its target counts as held back [rad]."""


TRIES = 6
"""How often it is tried to let only some joints brake before the robot touches itself; then all do."""


@dataclass
class Interventions:
    """How often a joint was held back for a tick, by the limit that was asked to be broken.

    `acceleration` also counts catching up afterwards, `collision` ticks in which the robot would have come to
    touch itself.
    """

    position: int = 0
    velocity: int = 0
    acceleration: int = 0
    collision: int = 0


class Envelope:
    """Keeps position, velocity and acceleration limits; what is not a number is answered with braking.

    A joint that begins away from its target, such as an arm that hung down, first goes there slowly.

    Args:
        limits: The joints' limits.
        dt: Length of a tick [s].
        positions: (j,) where the joints are, at rest [rad].
        guard: Keeps the robot off itself.

    Attributes:
        interventions: What it had to hold back so far.
        kept_off: (j,) which joints brake, or stand, so that the robot does not touch itself.
    """

    def __init__(
        self, limits: JointLimits, dt: float, positions: np.ndarray, guard: CollisionGuard | None = None
    ):
        self.interventions = Interventions()
        self._limits = limits
        self._follower = Follower(limits, dt, positions)
        self._met = np.zeros(len(positions), bool)
        self._guard = guard
        self.kept_off = np.zeros(len(positions), bool)
        if guard:
            guard.reset(positions)

    @property
    def positions(self) -> np.ndarray:
        """(j,) where the joints were last sent [rad]."""
        return self._follower.position

    @property
    def velocities(self) -> np.ndarray:
        """(j,) how fast they move there [rad/s]."""
        return self._follower.velocity

    def reset(self, positions: np.ndarray, joints: np.ndarray | None = None) -> None:
        """Start again from joints at rest, at (j,) positions [rad]; with a (j,) mask, those joints alone."""
        if joints is None:
            joints = np.ones(len(positions), bool)
        follower = self._follower
        follower.reset(
            np.where(joints, positions, follower.position), np.where(joints, 0.0, follower.velocity)
        )
        self.ease(joints)
        if self._guard and joints.any():
            self._guard.reset(follower.position)

    def ease(self, joints: np.ndarray) -> None:
        """Let the joints of a (j,) mask approach their targets slowly until they have met them again."""
        self._met = self._met & ~joints

    def step(
        self, positions: np.ndarray, velocities: np.ndarray, speed: np.ndarray | float = 1.0
    ) -> np.ndarray:
        """Move for one tick toward a target, as far as the limits allow.

        Args:
            positions: (j,) asked for [rad]; NaN lets the joint brake.
            velocities: (j,) asked for [rad/s].
            speed: (j,) or one share of the velocity limits that may be used, such as of a warm servo.

        Returns:
            (j,) positions that are safe to send [rad].
        """
        follower, limits = self._follower, self._limits
        asked = np.isfinite(positions) & np.isfinite(velocities)
        # Braking evenly within the tick leads here: this target asks for nothing else.
        stop = follower.position + 0.5 * follower.dt * follower.velocity
        target = np.where(asked, positions, stop)
        wanted = np.where(asked, velocities, 0.0)
        self._met |= asked & (np.abs(follower.position - target) < MET)
        fastest = speed * limits.velocity
        fastest = np.where(self._met, fastest, np.minimum(fastest, EASING_VELOCITY))
        follower.limits = replace(limits, velocity=fastest)
        sent, self.kept_off = self._move(target, wanted, stop)

        held_back = asked & self._met & ~self.kept_off & (np.abs(sent - target) > HELD_BACK)
        outside = (target < limits.lower) | (target > limits.upper)
        too_fast = ~outside & (np.abs(wanted) > limits.velocity)
        self.interventions.position += int(np.count_nonzero(held_back & outside))
        self.interventions.velocity += int(np.count_nonzero(held_back & too_fast))
        self.interventions.acceleration += int(np.count_nonzero(held_back & ~outside & ~too_fast))
        return sent

    def _move(
        self, target: np.ndarray, wanted: np.ndarray, stop: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Move for one tick, and tell which joints had to brake so that the robot does not touch itself.

        Where two arms come close to each other, one of them brakes, if that is enough.
        """
        follower, guard = self._follower, self._guard
        before = follower.position, follower.velocity
        untried = deque([np.zeros(len(target), bool)])
        for _ in range(TRIES):
            if not untried:
                break
            braking = untried.popleft()
            sent, velocities = follower.step(np.where(braking, stop, target), np.where(braking, 0.0, wanted))
            sides = guard.touching(sent, velocities) if guard else []
            if not sides:
                break
            follower.reset(*before)
            untried += [braking | side for side in sides if (side & ~braking).any()]
        if sides:
            braking = np.ones(len(target), bool)
            sent, _ = follower.brake()
        if guard:
            guard.moved(sent, surely=not sides)
        self.interventions.collision += bool(braking.any())
        return sent, braking
