"""One virtual servo: its control table, its controller, and the joint that it turns."""

import math
from dataclasses import dataclass

from gesture_bot.servo.models import (
    BAUD_RATES,
    POSITION_MODE,
    RPM,
    WATCHDOG_ERROR,
    WATCHDOG_UNIT,
    X,
    find_model,
)
from gesture_bot.servo.virtual_joint import Drive, FirstOrderJoint, Joint
from gesture_bot.servo.virtual_profile import Profile
from gesture_bot.servo.virtual_table import INITIAL, VirtualTable

BANDWIDTH = 60.0
"""Natural frequency of a joint without a body [rad/s]; it follows a moving goal 2 / 60 s behind."""

STIFFNESS = 640 / 128 / 885 * 4096 / (2 * math.pi)
"""Share of the full voltage for an error of 1 rad, at the initial Position P Gain (84). So it is in an
XL430-W250. The e-Manual does not tell the scale of the gain of the P series."""

DERIVATIVE = 1 / 16 / 885 * 0.001
"""Share of the full voltage for 1 tick/s, at a Position D Gain (80) of 1. The e-Manual gives the scale, 1/16,
but not for which time the difference is; a millisecond is assumed. Only the MuJoCo physics heed the gain."""

TIME_BASED = 1 << 2
"""Bit of Drive Mode (10): Profile Velocity and Profile Acceleration are times [ms]."""

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
    """A servo to simulate.

    Attributes:
        id: Its ID.
        model: Name of the model.
        ticks: Where its joint stands [ticks].
        baudrate: [bit/s].
        joint: Name of the joint; servo angle = direction * joint angle + offset [rad].
        direction: +1 or -1.
        offset: [rad].
    """

    id: int
    model: str
    ticks: int = 2048
    baudrate: int = BAUD_RATES[INITIAL["Baud Rate"]]
    joint: str = ""
    direction: int = 1
    offset: float = 0.0


class VirtualServo(VirtualTable):
    """A servo, and the joint that it turns while torque is on, in position mode.

    The profile leads to Goal Position, by Profile Velocity and Profile Acceleration; these are velocity and
    acceleration or, as Drive Mode says, times.

    Args:
        spec: Which servo.
        joint: The joint; if not given, one without a body, in closed form.

    Attributes:
        position: Where the joint is [ticks], not counting Homing Offset.
        velocity: How fast it turns [ticks/s].
        temperature: [degC].
        power: False: the supply is off, and the joint limp. `reboot` switches it on.
        stuck: The joint does not turn, whatever the motor does; it stays at `position`.
    """

    def __init__(self, spec: ServoSpec, joint: Joint | None = None):
        super().__init__(find_model(spec.model))
        self._joint = joint or FirstOrderJoint(self.model, BANDWIDTH)
        self.position = float(spec.ticks)
        self.velocity = 0.0
        self.temperature = ROOM
        self.power = True
        self.stuck = False
        self._load = 0.0
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
            self._move(None, seconds)
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
        if powered and self.get("Operating Mode") == POSITION_MODE:
            self._move(self._control(seconds), seconds)
        else:
            self._move(None, seconds)
            self._profile, self._new_goal = Profile(self.position), True
        settled = ROOM + FULL_LOAD_HEATING * self._load * self._load
        self.temperature += (settled - self.temperature) * min(seconds / HEATING_TIME, 1.0)

    def read(self, address: int, size: int) -> bytes:
        """Some bytes of the control table, as things are now; where no register lies, they are zero."""
        self._show()
        return super().read(address, size)

    def _move(self, drive: Drive | None, seconds: float) -> None:
        """Let the motor do what it is told, if anything. The load is a share of the stall torque."""
        self.position, self.velocity, self._load = self._joint.move(
            self.position, self.velocity, drive, self.stuck, seconds
        )

    def _control(self, seconds: float) -> Drive:
        """Go along the profile: where the motor is to be, and how hard it tries."""
        profile, series, scale = self._profile, self.model.series, self.model.ticks_per_radian
        if self._new_goal:
            goal = self.get("Goal Position") - self.homing
            velocity, acceleration = self.get("Profile Velocity"), self.get("Profile Acceleration")
            if self.get("Drive Mode") & TIME_BASED:
                profile.begin_timed(goal, velocity / 1000, acceleration / 1000)
            else:
                speed = velocity * series.velocity_unit * scale
                profile.begin(goal, speed, acceleration * series.acceleration_unit * scale)
            self._new_goal = False
        begin = profile.position
        profile.advance(seconds)
        return Drive(
            begin=begin,
            end=profile.position,
            stiffness=self.get("Position P Gain") / self._initial["Position P Gain"] * STIFFNESS / scale,
            damping=self.get("Position D Gain") * DERIVATIVE if series is X else 0.0,
            limit=min(self.get("Goal PWM"), self.get("PWM Limit")) / self._initial["PWM Limit"],
        )

    def _protect(self) -> None:
        """Report overheating, and switch torque off until a reboot, where Shutdown (63) says so."""
        if self.temperature > self.get("Temperature Limit"):
            self.set("Hardware Error Status", self.get("Hardware Error Status") | OVERHEATING)
        if self.get("Hardware Error Status") & self.get("Shutdown"):
            self.set("Torque Enable", 0)

    def _show(self) -> None:
        """Bring the registers that only tell up to date: when they are read, since time passes more often."""
        velocity_unit = self.model.series.velocity_unit * self.model.ticks_per_radian
        self.set("Present Load", round(self._load * self.model.torque / self.model.effort_unit))
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
