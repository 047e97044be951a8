"""One virtual servo: its control table, and the joint that it turns."""

import math
from dataclasses import dataclass

from gesture_bot.servo.models import (
    BAUD_RATES,
    POSITION_MODE,
    RPM,
    WATCHDOG_ERROR,
    WATCHDOG_UNIT,
    find_model,
)
from gesture_bot.servo.virtual_profile import Profile
from gesture_bot.servo.virtual_table import INITIAL, VirtualTable

BANDWIDTH = 60.0
"""Natural frequency of the critically damped joint [rad/s]; it follows a moving goal 2 / 60 s behind."""

STIFFNESS = 640 / 128 / 885 * 4096 / (2 * math.pi)
"""Share of the full voltage for an error of 1 rad, at the initial Position P Gain (84). So it is in an
XL430-W250. The e-Manual does not tell the scale of the gain of the P series."""

IN_POSITION, ONGOING, KIND = 1 << 0, 1 << 1, 1 << 4
"""Bits of Moving Status (123), and the place of the profile's type."""

ROOM = 25.0
"""Temperature of the room [degC]."""

FULL_LOAD_HEATING = 40.0
"""A servo at full load ends this much warmer than the room [K], with the time constant HEATING_TIME [s]."""
HEATING_TIME = 120.0

OVERHEATING = 1 << 2
"""Bit of Hardware Error Status (70)."""


@dataclass(frozen=True)
class ServoSpec:
    """A servo to simulate: ID, name of the model, where its joint stands [ticks], baud rate [bit/s]."""

    id: int
    model: str
    ticks: int = 2048
    baudrate: int = BAUD_RATES[INITIAL["Baud Rate"]]


class VirtualServo(VirtualTable):
    """A servo whose joint follows its profile as a critically damped second-order system.

    It moves while torque is on, in position mode, no faster than the no-load speed. The profile leads to Goal
    Position, by Profile Velocity and Profile Acceleration; it is always velocity-based.

    Attributes:
        position: Where the joint is [ticks], not counting Homing Offset.
        velocity: How fast it turns [ticks/s].
        temperature: [degC].
        power: False: the supply is off, and the joint limp. `reboot` switches it on.
        stuck: The joint does not turn, whatever the motor does; it stays at `position`.
    """

    def __init__(self, spec: ServoSpec):
        super().__init__(find_model(spec.model))
        self.position = float(spec.ticks)
        self.velocity = 0.0
        self.temperature = ROOM
        self.power = True
        self.stuck = False
        self._silence = 0.0
        self._uptime = 0.0
        self._profile = Profile(self.position)
        self._new_goal = True
        self._switch_on(first_address=0)
        self.set("ID", spec.id)
        self.set("Baud Rate", next(value for value, rate in BAUD_RATES.items() if rate == spec.baudrate))

    @property
    def baudrate(self) -> int:
        """At what speed it hears and speaks [bit/s]."""
        return BAUD_RATES[self.get("Baud Rate")]

    def set(self, name: str, value: int) -> None:
        """Set a register, also one that a packet may not write."""
        super().set(name, value)
        self._new_goal |= name == "Goal Position"

    def reboot(self) -> None:
        """Switch off and on: torque is off, and RAM is as it was at the start."""
        self.power = True
        self._switch_on(self.model.series.ram)

    def hear(self) -> None:
        """An instruction packet is on the bus, for whomever: Bus Watchdog starts counting again."""
        self._silence = 0.0

    def advance(self, seconds: float) -> None:
        """Let time pass: the joint moves, the motor warms or cools, Bus Watchdog counts."""
        if not self.power:
            self.velocity = 0.0
            return
        self._uptime += seconds
        self._silence += seconds
        self._protect()
        powered = self.get("Torque Enable") == 1
        watchdog = self.get("Bus Watchdog")
        if powered and 0 < watchdog < WATCHDOG_ERROR and self._silence > watchdog * WATCHDOG_UNIT:
            self.set("Bus Watchdog", WATCHDOG_ERROR)
            self.set("Goal Position", round(self.position) + self.homing)
            self._profile.begin(round(self.position), 0.0, 0.0)
            self._new_goal = False
        load = 0.0
        if powered and self.get("Operating Mode") == POSITION_MODE:
            load = self._follow(seconds)
        else:
            self.velocity = 0.0
            self._profile, self._new_goal = Profile(self.position), True
        settled = ROOM + FULL_LOAD_HEATING * load * load
        self.temperature += (settled - self.temperature) * min(seconds / HEATING_TIME, 1.0)
        self._show(load)

    def _follow(self, seconds: float) -> float:
        """Move along the profile, in closed form; returns the load as a share of the stall torque."""
        profile, series, scale = self._profile, self.model.series, self.model.ticks_per_radian
        if self._new_goal:
            speed = self.get("Profile Velocity") * series.velocity_unit * scale
            acceleration = self.get("Profile Acceleration") * series.acceleration_unit * scale
            profile.begin(self.get("Goal Position") - self.homing, speed, acceleration)
            self._new_goal = False
        start = profile.position
        profile.advance(seconds)
        if self.stuck:
            self.velocity = 0.0
        elif seconds:
            # A joint that follows a ramp is 2 / BANDWIDTH behind it in the end.
            ramp = (profile.position - start) / seconds
            error = self.position - start + 2 * ramp / BANDWIDTH
            pull = self.velocity - ramp + BANDWIDTH * error
            decay = math.exp(-BANDWIDTH * seconds)
            moved = ramp * seconds + (error + pull * seconds) * decay - error
            velocity = ramp + (pull - BANDWIDTH * (error + pull * seconds)) * decay
            fastest = self.model.speed * RPM * scale
            self.position += max(-fastest * seconds, min(fastest * seconds, moved))
            self.velocity = max(-fastest, min(fastest, velocity))
        # The motor's voltage is the proportional gain times the position error.
        gain = self.get("Position P Gain") / self._initial["Position P Gain"] * STIFFNESS
        return max(-1.0, min(1.0, gain * (profile.position - self.position) / scale))

    def _protect(self) -> None:
        """Report overheating, and switch torque off until a reboot, where Shutdown (63) says so."""
        if self.temperature > self.get("Temperature Limit"):
            self.set("Hardware Error Status", self.get("Hardware Error Status") | OVERHEATING)
        if self.get("Hardware Error Status") & self.get("Shutdown"):
            self.set("Torque Enable", 0)

    def _show(self, load: float) -> None:
        velocity_unit = self.model.series.velocity_unit * self.model.ticks_per_radian
        self.set("Present Load", round(load * self.model.torque / self.model.effort_unit))
        self.set("Present Velocity", round(self.velocity / velocity_unit))
        self.set("Present Position", round(self.position) + self.homing)
        self.set("Present Temperature", round(self.temperature))
        self.set("Moving", abs(self.velocity) > self.get("Moving Threshold") * velocity_unit)
        profile = self._profile
        arrived = not profile.ongoing and round(self.position) == round(profile.position)
        self.set("Moving Status", IN_POSITION * arrived | ONGOING * profile.ongoing | KIND * profile.kind)
        self.set("Velocity Trajectory", round(profile.velocity / velocity_unit))
        self.set("Position Trajectory", round(profile.position) + self.homing)
        self.set("Realtime Tick", int(self._uptime * 1000) % 32768)

    def _switch_on(self, first_address: int) -> None:
        model = self.model
        fastest = round(model.speed * RPM / model.series.velocity_unit)
        own = {
            "Model Number": model.number,
            "Velocity Limit": min(fastest, self._limits["Velocity Limit"][1]),
            "Min Position Limit": model.first,
            "Max Position Limit": model.last,
            "Present Input Voltage": round(10 * model.voltage),
            "Goal Position": round(self.position) + self.homing,
        }
        self._reset(first_address, own)
        self.advance(0.0)
