"""One virtual servo: its control table by the e-Manual's rules, and the joint that it turns."""

import math
from dataclasses import dataclass

from dynamixel_easy_sdk.data_types import ControlTableItem
from dynamixel_sdk.protocol2_packet_handler import (
    ERRNUM_ACCESS,
    ERRNUM_DATA_LENGTH,
    ERRNUM_DATA_LIMIT,
    ERRNUM_DATA_RANGE,
)

from gesture_bot.servo.models import (
    ACCELERATION_UNIT,
    BAUD_RATES,
    CENTRE,
    HOMING_RANGE,
    POSITION_MODE,
    TICKS_PER_RADIAN,
    VELOCITY_UNIT,
    WATCHDOG_ERROR,
    WATCHDOG_UNIT,
    find_model,
)
from gesture_bot.servo.virtual_profile import Profile

RAM = 64
"""Registers below this address are EEPROM: they can be written only while torque is off."""

BANDWIDTH = 60.0
"""Natural frequency of the critically damped joint [rad/s]; it follows a moving goal 2 / 60 s behind."""

IN_POSITION, ONGOING, KIND = 1 << 0, 1 << 1, 1 << 4
"""Bits of Moving Status (123), and the place of the profile's type."""

INDIRECT = ((168, 224, 28), (578, 634, 28))
"""First Indirect Address, first Indirect Data, and how many; an XL330 has the first block alone."""

ROOM = 25.0
"""Temperature of the room [degC]."""

FULL_LOAD_HEATING = 40.0
"""A servo at full load ends this much warmer than the room [K], with the time constant HEATING_TIME [s]."""
HEATING_TIME = 120.0

WRITABLE = {
    "ID": (0, 252), "Baud Rate": (0, 7), "Return Delay Time": (0, 254), "Drive Mode": (0, 13),
    "Operating Mode": (0, 16), "Secondary(Shadow) ID": (0, 255), "Homing Offset": (-1044479, 1044479),
    "Moving Threshold": (0, 1023), "Temperature Limit": (0, 100), "Max Voltage Limit": (31, 160),
    "Min Voltage Limit": (31, 160), "PWM Limit": (0, 885), "Current Limit": (0, 2047),
    "Velocity Limit": (0, 2047), "Max Position Limit": (0, 4095), "Min Position Limit": (0, 4095),
    "Shutdown": (0, 255), "Torque Enable": (0, 1), "LED": (0, 1), "Status Return Level": (0, 2),
    "Velocity I Gain": (0, 16383), "Velocity P Gain": (0, 16383), "Position D Gain": (0, 16383),
    "Position I Gain": (0, 16383), "Position P Gain": (0, 16383), "Feedforward 2nd Gain": (0, 16383),
    "Feedforward 1st Gain": (0, 16383), "Bus Watchdog": (0, 127), "Goal PWM": (-885, 885),
    "Goal Current": (-2047, 2047), "Goal Velocity": (-2047, 2047), "Profile Acceleration": (0, 32767),
    "Profile Velocity": (0, 32767), "Goal Position": (-1048575, 1048575),
}  # fmt: skip
"""Smallest and largest value that each writable register takes in any model; all others are read-only."""

INITIAL = {
    "Firmware Version": 48, "Baud Rate": 3, "Return Delay Time": 250, "Operating Mode": POSITION_MODE,
    "Secondary(Shadow) ID": 255, "Protocol Type": 2, "Moving Threshold": 10, "Temperature Limit": 72,
    "Max Voltage Limit": 140, "Min Voltage Limit": 60, "PWM Limit": 885, "Current Limit": 1193,
    "Max Position Limit": 4095, "Shutdown": 52, "Status Return Level": 2, "Velocity I Gain": 1000,
    "Velocity P Gain": 100, "Position P Gain": 640, "Goal PWM": 885, "Goal Current": 1193,
}  # fmt: skip
"""What any virtual servo holds at first, where that is not zero: the e-Manual's values for an XL430-W250, but
for the baud rate and the current limit."""

OVERHEATING = 1 << 2
"""Bit of Hardware Error Status (70)."""

GOALS = ("Goal PWM", "Goal Current", "Goal Velocity", "Goal Position")


@dataclass(frozen=True)
class ServoSpec:
    """A servo to simulate: ID, name of the model, where its joint stands [ticks], baud rate [bit/s]."""

    id: int
    model: str
    ticks: int = CENTRE
    baudrate: int = BAUD_RATES[INITIAL["Baud Rate"]]


class VirtualServo:
    """A servo whose joint follows its profile as a critically damped second-order system.

    It moves while torque is on, in position mode, no faster than the no-load speed. The profile leads to Goal
    Position, by Profile Velocity and Profile Acceleration; it is always velocity-based.

    Attributes:
        memory: The control table, byte by byte.
        position: Where the joint is [ticks], not counting Homing Offset.
        velocity: How fast it turns [ticks/s].
        temperature: [degC].
        power: False: the supply is off, and the joint limp. `reboot` switches it on.
        stuck: The joint does not turn, whatever the motor does; it stays at `position`.
    """

    def __init__(self, spec: ServoSpec):
        self.model = find_model(spec.model)
        self.memory = bytearray(1024)
        self._table = dict(self.model.table)
        self._limits = dict(WRITABLE)
        self._pointers: dict[int, int] = {}
        self._add_indirect()
        self._names = {item.address: name for name, item in self._table.items() if name in self._limits}
        self.position = float(spec.ticks)
        self.velocity = 0.0
        self.temperature = ROOM
        self.power = True
        self.stuck = False
        self._silence = 0.0
        self._uptime = 0.0
        self._profile = Profile(self.position)
        self._planned: int | None = None
        self._switch_on(first_address=0)
        self.set("ID", spec.id)
        self.set("Baud Rate", next(value for value, rate in BAUD_RATES.items() if rate == spec.baudrate))

    @property
    def baudrate(self) -> int:
        """At what speed it hears and speaks [bit/s]."""
        return BAUD_RATES[self.get("Baud Rate")]

    @property
    def homing(self) -> int:
        """What is added to the position in all registers [ticks]; too large an offset is ignored."""
        offset = self.get("Homing Offset")
        return offset if abs(offset) <= HOMING_RANGE or self.get("Operating Mode") != POSITION_MODE else 0

    def get(self, name: str) -> int:
        """The value of a register."""
        item = self._table[name]
        smallest, _ = self._limits.get(name, (0, 0))
        data = self.memory[item.address : item.address + item.size]
        return int.from_bytes(data, "little", signed=smallest < 0)

    def set(self, name: str, value: int) -> None:
        """Set a register, also one that a packet may not write."""
        item = self._table[name]
        self.memory[item.address : item.address + item.size] = (value % (1 << 8 * item.size)).to_bytes(
            item.size, "little"
        )

    def reboot(self) -> None:
        """Switch off and on: torque is off, and RAM is as it was at the start."""
        self.power = True
        self._switch_on(first_address=RAM)

    def hear(self) -> None:
        """An instruction packet is on the bus, for whomever: Bus Watchdog starts counting again."""
        self._silence = 0.0

    def read(self, address: int, size: int) -> bytes:
        """Some bytes of the control table; where no register lies, they are zero."""
        end = min(address + size, len(self.memory))
        return bytes(self.memory[self._target(at)] for at in range(address, end))

    def write(self, address: int, data: bytes) -> int:
        """Write registers that lie side by side, all or none, and return the status packet's error number."""
        values = {}
        targets = [self._target(at) for at in range(address, address + len(data))]
        while data:
            name = self._names.get(targets[0])
            if name is None or (targets[0] < RAM and self.get("Torque Enable")):
                return ERRNUM_ACCESS
            size = self._table[name].size
            if targets[:size] != list(range(targets[0], targets[0] + size)):
                return ERRNUM_DATA_LENGTH
            smallest, largest = self._limits[name]
            values[name] = int.from_bytes(data[:size], "little", signed=smallest < 0)
            if not smallest <= values[name] <= largest:
                return ERRNUM_DATA_RANGE
            if name in GOALS and self.get("Bus Watchdog") == WATCHDOG_ERROR:
                return ERRNUM_DATA_RANGE
            targets, data = targets[size:], data[size:]
        lowest, highest = self.get("Min Position Limit"), self.get("Max Position Limit")
        if not lowest <= values.get("Goal Position", lowest) <= highest:
            return ERRNUM_DATA_LIMIT
        for name, value in values.items():
            self.set(name, value)
        if "Goal Position" in values:
            self._planned = None
        return 0

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
            self._planned = round(self.position) + self.homing
            self.set("Goal Position", self._planned)
            self._profile.begin(round(self.position), 0.0, 0.0)
        load = 0.0
        if powered and self.get("Operating Mode") == POSITION_MODE:
            load = self._follow(seconds)
        else:
            self.velocity = 0.0
            self._profile, self._planned = Profile(self.position), None
        settled = ROOM + FULL_LOAD_HEATING * load * load
        self.temperature += (settled - self.temperature) * min(seconds / HEATING_TIME, 1.0)
        self._show(load)

    def _follow(self, seconds: float) -> float:
        """Move along the profile, in closed form; returns the load as a share of the stall torque."""
        goal, profile = self.get("Goal Position"), self._profile
        if goal != self._planned:
            speed = self.get("Profile Velocity") * VELOCITY_UNIT * TICKS_PER_RADIAN
            acceleration = self.get("Profile Acceleration") * ACCELERATION_UNIT * TICKS_PER_RADIAN
            profile.begin(goal - self.homing, speed, acceleration)
            self._planned = goal
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
            fastest = TICKS_PER_RADIAN * self.model.speed * 2 * math.pi / 60
            self.position += max(-fastest * seconds, min(fastest * seconds, moved))
            self.velocity = max(-fastest, min(fastest, velocity))
        # The motor's voltage is the proportional gain times the position error (Position P Gain, 84).
        drive = self.get("Position P Gain") / 128 * (profile.position - self.position) / self.get("PWM Limit")
        return max(-1.0, min(1.0, drive))

    def _protect(self) -> None:
        """Report overheating, and switch torque off until a reboot, where Shutdown (63) says so."""
        if self.temperature > self.get("Temperature Limit"):
            self.set("Hardware Error Status", self.get("Hardware Error Status") | OVERHEATING)
        if self.get("Hardware Error Status") & self.get("Shutdown"):
            self.set("Torque Enable", 0)

    def _show(self, load: float) -> None:
        current_unit = self.model.current_unit
        if current_unit:
            self.set("Present Current", round(load * self.model.current / current_unit))
        else:
            self.set("Present Load", round(load * 1000))
        self.set("Present Velocity", round(self.velocity / TICKS_PER_RADIAN / VELOCITY_UNIT))
        self.set("Present Position", round(self.position) + self.homing)
        self.set("Present Temperature", round(self.temperature))
        self.set(
            "Moving", abs(self.velocity) > self.get("Moving Threshold") * VELOCITY_UNIT * TICKS_PER_RADIAN
        )
        profile = self._profile
        arrived = not profile.ongoing and round(self.position) == round(profile.position)
        self.set("Moving Status", IN_POSITION * arrived | ONGOING * profile.ongoing | KIND * profile.kind)
        self.set("Velocity Trajectory", round(profile.velocity / TICKS_PER_RADIAN / VELOCITY_UNIT))
        self.set("Position Trajectory", round(profile.position) + self.homing)
        self.set("Realtime Tick", int(self._uptime * 1000) % 32768)

    def _target(self, address: int) -> int:
        """Where a byte really lies: an Indirect Data is where its Indirect Address says."""
        pointer = self._pointers.get(address)
        return address if pointer is None else int.from_bytes(self.memory[pointer : pointer + 2], "little")

    def _add_indirect(self) -> None:
        """Add all Indirect Addresses and Data to the table; the SDK lists the first of them."""
        first, last, number = RAM, INDIRECT[-1][1] + INDIRECT[-1][2] - 1, 0
        known = {item.address for item in self._table.values()}
        for pointers, data, count in INDIRECT:
            for at in range(count if pointers in known else 0):
                number += 1
                for name, address, size, limits in (
                    (f"Indirect Address {number}", pointers + 2 * at, 2, (first, last)),
                    (f"Indirect Data {number}", data + at, 1, (0, 255)),
                ):
                    self._table[name] = ControlTableItem(address, size)
                    self._limits[name] = limits
                self._pointers[data + at] = pointers + 2 * at

    def _switch_on(self, first_address: int) -> None:
        own = {
            "Model Number": self.model.number,
            "Velocity Limit": round(self.model.speed / 0.229),
            "Present Input Voltage": round(10 * self.model.voltage),
            "Goal Position": round(self.position) + self.homing,
        }
        for name, item in self._table.items():
            if item.address >= first_address:
                self.set(name, own.get(name, INITIAL.get(name, 0)))
        for data, pointer in self._pointers.items():
            if pointer >= first_address:  # at first, an Indirect Data is a byte of its own
                self.memory[pointer : pointer + 2] = data.to_bytes(2, "little")
        self.advance(0.0)
