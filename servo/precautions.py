"""What joints do instead of what is planned while something is the matter with one or all of them."""

import numpy as np

from gesture_bot.retarget.robot import Robot
from gesture_bot.servo.condition import NO_ANSWER, RELAXED
from gesture_bot.servo.envelope import Envelope
from gesture_bot.servo.following import Following
from gesture_bot.servo.status import Status
from gesture_bot.servo.upkeep import Upkeep

AT_REST = 1e-3
"""A hot joint that was sent this close to its rest position is switched off [rad]."""

PATIENCE = 2.0
"""A joint that the collision guard holds for so long is told; a hot one is switched off there [s]."""

STILL = 1e-3
"""Joints that are sent no faster than this stand [rad/s] ..."""

SETTLED = 0.3
"""... and have come to rest when that is so long ago [s], since servos are behind their goals."""


class Precautions:
    """Leaves out what is out of service; hot joints go to rest and off, blocked ones yield, all may hold.

    Args:
        robot: Whose joints they are.
        dt: Length of a tick [s].
        envelope: Knows where the joints are sent.
        upkeep: Knows which servos are out of service, and which are hot.
        following: Knows which joints are blocked.

    Attributes:
        holding: Whether all joints hold.
    """

    def __init__(self, robot: Robot, dt: float, envelope: Envelope, upkeep: Upkeep, following: Following):
        self.holding = False
        self._robot = robot
        self._dt = dt
        self._envelope = envelope
        self._upkeep = upkeep
        self._following = following
        self._stood = 0.0
        self._kept_off = np.zeros(len(robot.joints))

    def asked(
        self, positions: np.ndarray, velocities: np.ndarray, active: bool, stopped: bool, now: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """What the joints are asked for [rad, rad/s], where so much is planned; NaN is to brake and hold."""
        upkeep, hot = self._upkeep, self._upkeep.heat.hot
        out = upkeep.out
        faulty = self._robot.bus.on_fault == "stop" and bool((out | hot).any())
        holding = stopped or not active or upkeep.relaxed or faulty
        everyone = np.full(len(hot), self.holding and not holding)
        self._envelope.ease(everyone | hot | self._following.release(now))
        self.holding = holding
        positions = np.where(holding | out, np.nan, positions)
        positions = np.where(hot & ~out & (not stopped), self._robot.rest, positions)
        return self._following.soften(positions, np.where(hot, 0.0, velocities))

    def observe(
        self, measured: np.ndarray, efforts: np.ndarray, fresh: np.ndarray, stopped: bool, now: float
    ) -> None:
        """After a cycle, see which joints are out of service, limp, blocked, or to be switched off.

        Args:
            measured: (j,) [rad].
            efforts: (j,) [N m].
            fresh: (j,) who was heard.
            stopped: Whether a stop is in force.
            now: On the monotonic clock [s].

        Raises:
            PortError: The port has vanished.
        """
        upkeep, following, envelope = self._upkeep, self._following, self._envelope
        back = upkeep.heed()
        out = upkeep.out
        # What is out of service starts again from where it is.
        if (moved := out | back).any():
            envelope.reset(measured, moved)
        following.compare(envelope.positions.copy(), measured, efforts, ~out & fresh, now)
        upkeep.odd = following.limp
        # On a stop, a hot joint may go nowhere: it is switched off where it stands.
        goal = envelope.positions if stopped else self._robot.rest
        still = np.abs(envelope.velocities) < STILL
        rested = still & (np.abs(envelope.positions - goal) < AT_REST)
        self._kept_off = np.where(envelope.kept_off, self._kept_off + self._dt, 0.0)
        rested |= self._kept_off > PATIENCE
        for joint in np.flatnonzero(upkeep.heat.hot & ~out & (rested | following.yielding)):
            upkeep.switch_off(int(joint))
        self._stood = self._stood + self._dt if still.all() else 0.0
        # On a stop, torque goes off once the joints stand, if so configured; afterwards, on again.
        relax = stopped and self._robot.bus.on_stop == "relax"
        if relax and not upkeep.slack and self._stood >= SETTLED:
            upkeep.relax()
        elif upkeep.slack and not relax:
            upkeep.tighten()

    def unplanned(self) -> np.ndarray:
        """(j,) which joints do not do what is planned."""
        return self._upkeep.out | self._upkeep.heat.hot | self._following.yielding | self.holding

    def tell(self, status: Status) -> None:
        """Say how the joints are."""

        def names(joints: np.ndarray) -> tuple[str, ...]:
            return tuple(self._robot.joints[joint] for joint in np.flatnonzero(joints))

        upkeep, reasons = self._upkeep, self._upkeep.reasons
        status.holding = self.holding
        status.health = upkeep.health
        status.out = {joint: reason for joint, reason in reasons.items() if reason != RELAXED}
        status.relaxed = upkeep.relaxed
        status.silent = tuple(joint for joint, reason in reasons.items() if reason == NO_ANSWER)
        status.warm = names(upkeep.heat.speed < 1.0)
        status.yielding = names(self._following.yielding)
        status.blocks = self._following.blocks
        status.kept_off = names(self._kept_off > PATIENCE)
