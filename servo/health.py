"""How a servo is, and what that lets its joint do."""

from dataclasses import dataclass

import numpy as np

from gesture_bot.retarget.description import Bus as BusDescription
from gesture_bot.servo.bus import Bus
from gesture_bot.servo.models import WATCHDOG_ERROR, Model, signed
from gesture_bot.servo.preparation import hardware_errors

SLOWEST = 0.3
"""Share of its velocity limit at which the joint of a servo moves that is nearly hot."""

REBOOTED = "was switched off and on"
BITTEN = "was stopped by its watchdog"
"""Why a servo that was set up does not do what it is told."""


@dataclass(frozen=True)
class Health:
    """A servo's state.

    Attributes:
        temperature: [degC].
        voltage: [V].
        load: Share of the stall torque, signed as the servo turns.
        errors: The hardware errors it reports.
        torque: Whether torque is on.
        watchdog: Bus Watchdog (98): 0 is not armed, as after a reboot.
    """

    temperature: float
    voltage: float
    load: float
    errors: tuple[str, ...]
    torque: bool
    watchdog: int

    @property
    def trouble(self) -> str:
        """Why the servo does not do what it is told, although it was set up; empty if it does."""
        if self.errors:
            return "reports " + " and ".join(self.errors)
        if not self.torque or self.watchdog == 0:
            return REBOOTED
        return BITTEN if self.watchdog == WATCHDOG_ERROR else ""


def read_health(bus: Bus, servo_id: int, model: Model) -> Health | None:
    """Ask a servo once how it is; None when it does not answer."""
    # One read covers torque, hardware errors, Bus Watchdog, load, voltage and temperature.
    first = bus.registers["Torque Enable"].address
    data = bus.try_read(servo_id, first, bus.registers["Present Temperature"].address + 1 - first)
    if not data:
        return None

    def register(name: str) -> int:
        item = bus.registers[name]
        start = item.address - first
        return int.from_bytes(data[start : start + item.size], "little")

    return Health(
        temperature=register("Present Temperature"),
        voltage=register("Present Input Voltage") / 10,
        load=signed(register("Present Load"), 2) * model.effort_unit / model.torque,
        errors=hardware_errors(register("Hardware Error Status")),
        torque=register("Torque Enable") == 1,
        watchdog=register("Bus Watchdog"),
    )


class Heat:
    """What the temperatures let the joints do: a warm servo slows, a hot one rests until it is cool.

    Args:
        limits: Says what is warm and what is hot.
        joints: How many there are.

    Attributes:
        speed: (j,) share of the velocity limits that the joints may use.
        hot: (j,) whose servo is to rest and switch off.
    """

    def __init__(self, limits: BusDescription, joints: int):
        self.speed = np.ones(joints)
        self.hot = np.zeros(joints, bool)
        self._warm, self._hot = limits.warm_degc, limits.hot_degc

    def feel(self, joint: int, temperature: float) -> None:
        """Take note of the temperature of a joint's servo [degC]."""
        self.speed[joint] = np.interp(temperature, (self._warm, self._hot), (1.0, SLOWEST))
        if temperature >= self._hot:
            self.hot[joint] = True
        elif temperature < self._warm:
            self.hot[joint] = False
