"""Looking after the servos while the robot moves: who is out of service, and bringing them back."""

import itertools
from collections.abc import Iterator
from contextlib import suppress

import numpy as np

from gesture_bot.base.errors import BusError, PortError
from gesture_bot.retarget.robot import Robot
from gesture_bot.servo.buses import RobotBus
from gesture_bot.servo.condition import HOT, NO_ANSWER, RELAXED, Condition
from gesture_bot.servo.health import BITTEN, REBOOTED, Health, Heat, read_health
from gesture_bot.servo.models import WATCHDOG_ERROR, WATCHDOG_UNIT, find_model
from gesture_bot.servo.preparation import setting_up
from gesture_bot.servo.present import PresentReader

HEALTH_PERIOD = 0.1
"""Time from looking after one servo to looking after the next [s]."""


class Upkeep:
    """Takes at most a few packets a tick: it asks a servo how it is, or goes on setting one up.

    A servo is out of service while it does not answer, reports an error, has been reset, is off to cool, or
    is relaxed. Once nothing speaks against it, it is set up again, and its joint starts from where it is.

    Args:
        bus: The bus, or all of them.
        robot: Whose servos they are; all are set up.
        reader: Knows who answers.

    Attributes:
        health: Health by joint, each as it was last told.
        heat: What the temperatures let the joints do.
        odd: (j,) joints that do not go where they are sent; set by the owner, they are asked soon.
        slack: Whether torque is to be off; `relax` and `tighten` set it.
    """

    def __init__(self, bus: RobotBus, robot: Robot, reader: PresentReader):
        self.health: dict[str, Health] = {}
        self.heat = Heat(robot.bus, len(robot.servos))
        self.odd = np.zeros(len(robot.servos), bool)
        self.slack = False
        self._bus = bus
        self._robot = robot
        self._reader = reader
        self._models = [find_model(servo.model) for servo in robot.servos]
        self._turns = self._take_turns()
        self._next = 0.0
        self._steps: Iterator[None] = iter(())
        self._conditions = [Condition() for _ in robot.servos]

    def step(self, now: float) -> None:
        """Do the next bit of work [s].

        Raises:
            PortError: The port has vanished.
        """
        try:
            next(self._steps)
        except StopIteration:
            if now >= self._next:
                self._next = now + HEALTH_PERIOD
                self._ask(next(self._turns))
        except PortError:
            raise
        except BusError:  # it has fallen silent again; its next turn comes
            self._steps = iter(())

    def heed(self) -> np.ndarray:
        """After a cycle, see who has fallen silent; returns (j,) who is back in service from now on.

        Raises:
            PortError: The port has vanished.
        """
        silent = self._reader.silent
        for servo, condition in zip(self._robot.servos, self._conditions, strict=True):
            if servo.id in silent:
                condition.put_out(NO_ANSWER)
        self._take_back()
        heard = zip(self._conditions, self._reader.fresh, strict=True)
        return np.array([bool(fresh) and condition.heard() for condition, fresh in heard])

    @property
    def out(self) -> np.ndarray:
        """(j,) which joints are out of service."""
        return np.array([condition.out for condition in self._conditions])

    @property
    def reasons(self) -> dict[str, str]:
        """Why those are, by joint."""
        joints = zip(self._robot.joints, self._conditions, strict=True)
        return {joint: condition.reason for joint, condition in joints if condition.out}

    @property
    def relaxed(self) -> bool:
        """Whether a joint is limp since `relax`."""
        return any(condition.reason == RELAXED for condition in self._conditions)

    def switch_off(self, joint: int, reason: str = HOT) -> None:
        """Let a servo be without torque, such as a hot one."""
        with suppress(BusError):  # one that does not answer is noticed by the reader
            servo_id = self._robot.servos[joint].id
            self._bus.of(servo_id).write(servo_id, "Torque Enable", 0)
            self._conditions[joint].put_out(reason)

    def relax(self) -> None:
        """Let all joints be without torque, at once, until `tighten`."""
        self.slack = True
        self._steps = iter(())  # whoever was being set up is not
        self._bus.set_all([servo.id for servo in self._robot.servos], "Torque Enable", 0)
        for condition in self._conditions:
            condition.put_out(condition.reason or RELAXED)

    def tighten(self) -> None:
        """Set the joints up again, one after the other, where they then are."""
        self.slack = False

    def _take_turns(self) -> Iterator[int]:
        """Each in turn; between two turns one that is out, since it may be back, or whose joint is odd."""
        for turn in itertools.count():
            yield turn % len(self._conditions)
            special = np.flatnonzero(self.out | self.odd)
            if len(special):
                yield int(special[turn % len(special)])

    def _ask(self, joint: int) -> None:
        servo, condition = self._robot.servos[joint], self._conditions[joint]
        health = read_health(self._bus.of(servo.id), servo.id, self._models[joint])
        if health is None:
            return
        self.health[servo.joint] = health
        self.heat.feel(joint, health.temperature)
        if condition.ready:
            return
        hot = bool(self.heat.hot[joint])
        if condition.out and hot and health.torque:
            self.switch_off(joint)
        if self.slack and not health.errors:
            # It may have missed the packet, or have been out of service for another reason.
            reason = HOT if hot else RELAXED
            if health.torque or condition.reason != reason:
                self.switch_off(joint, reason)
            return
        rightly_off = condition.out and (hot or condition.reason == RELAXED)
        if health.errors or (health.trouble and not rightly_off):
            condition.put_out(health.trouble)
        if condition.out and not health.errors and not hot:
            self._steps = self._bring_back(joint)

    def _take_back(self) -> None:
        """Servos whose line only hung go on where torque is on, and the watchdog armed and not bitten."""
        hung = {
            servo.id: condition
            for servo, condition in zip(self._robot.servos, self._conditions, strict=True)
            if condition.reason == NO_ANSWER and not condition.ready and servo.id not in self._reader.silent
        }
        torque = self._bus.sync_read(hung, "Torque Enable", 1, fast=False)
        for servo_id, watchdog in self._bus.sync_read(torque, "Bus Watchdog", 1, fast=False).items():
            if torque[servo_id] == b"\0" or watchdog == b"\0":
                hung[servo_id].put_out(REBOOTED)
            elif watchdog[0] == WATCHDOG_ERROR:
                hung[servo_id].put_out(BITTEN)
            else:
                hung[servo_id].set_up()

    def _bring_back(self, joint: int) -> Iterator[None]:
        servo = self._robot.servos[joint]
        bus = self._bus.of(servo.id)
        yield from setting_up(bus, self._robot, servo)
        yield
        bus.write(servo.id, "Bus Watchdog", round(self._robot.bus.watchdog_ms / 1000 / WATCHDOG_UNIT))
        self._reader.heard(servo.id)
        self._conditions[joint].set_up()
