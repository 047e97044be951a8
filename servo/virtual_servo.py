"""One virtual servo: its control table by the e-Manual's rules, and the joint that it turns."""

import math
from dataclasses import dataclass

from dynamixel_sdk.protocol2_packet_handler import (
    ERRNUM_ACCESS,
    ERRNUM_DATA_LENGTH,
    ERRNUM_DATA_LIMIT,
    ERRNUM_DATA_RANGE,
)

from gesture_bot.servo.models import (
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

RAM = 64
"""Registers below this address are EEPROM: they can be written only while torque is off."""

BANDWIDTH = 60.0
"""Natural frequency of the critically damped joint [rad/s]; it follows a moving goal 2 / 60 s behind."""

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
    """A servo whose joint follows Goal Position as a critically damped second-order system.

    It moves while torque is on, in position mode, no faster than Profile Velocity and the no-load speed.

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
        self._table = self.model.table
        self._names = {item.address: name for name, item in self._table.items() if name in WRITABLE}
        self.position = float(spec.ticks)
        self.velocity = 0.0
        self.temperature = ROOM
        self.power = True
        self.stuck = False
        self._silence = 0.0
        self._uptime = 0.0
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
        smallest, _ = WRITABLE.get(name, (0, 0))
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
        return bytes(self.memory[address : address + size])

    def write(self, address: int, data: bytes) -> int:
        """Write registers that lie side by side, all or none, and return the status packet's error number."""
        values = {}
        while data:
            name = self._names.get(address)
            if name is None or (address < RAM and self.get("Torque Enable")):
                return ERRNUM_ACCESS
            size = self._table[name].size
            if len(data) < size:
                return ERRNUM_DATA_LENGTH
            smallest, largest = WRITABLE[name]
            values[name] = int.from_bytes(data[:size], "little", signed=smallest < 0)
            if not smallest <= values[name] <= largest:
                return ERRNUM_DATA_RANGE
            if name in GOALS and self.get("Bus Watchdog") == WATCHDOG_ERROR:
                return ERRNUM_DATA_RANGE
            address, data = address + size, data[size:]
        lowest, highest = self.get("Min Position Limit"), self.get("Max Position Limit")
        if not lowest <= values.get("Goal Position", lowest) <= highest:
            return ERRNUM_DATA_LIMIT
        for name, value in values.items():
            self.set(name, value)
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
            self.set("Goal Position", round(self.position) + self.homing)
        load = 0.0
        if powered and self.get("Operating Mode") == POSITION_MODE:
            load = self._follow(self.get("Goal Position") - self.homing, seconds)
        else:
            self.velocity = 0.0
        settled = ROOM + FULL_LOAD_HEATING * load * load
        self.temperature += (settled - self.temperature) * min(seconds / HEATING_TIME, 1.0)
        self._show(load)

    def _follow(self, goal: float, seconds: float) -> float:
        """Move toward a goal [ticks] in closed form; returns the load as a share of the stall torque."""
        if self.stuck:
            self.velocity = 0.0
            return self._load(goal)
        error = self.position - goal
        pull = self.velocity + BANDWIDTH * error
        decay = math.exp(-BANDWIDTH * seconds)
        moved = (error + pull * seconds) * decay - error
        velocity = (self.velocity - BANDWIDTH * pull * seconds) * decay
        profile = self.get("Profile Velocity") * VELOCITY_UNIT
        no_load = self.model.speed * 2 * math.pi / 60
        fastest = TICKS_PER_RADIAN * (min(profile, no_load) if profile else no_load)
        self.position += max(-fastest * seconds, min(fastest * seconds, moved))
        self.velocity = max(-fastest, min(fastest, velocity))
        return self._load(goal)

    def _load(self, goal: float) -> float:
        # The motor's voltage is the proportional gain times the position error (Position P Gain, 84).
        drive = self.get("Position P Gain") / 128 * (goal - self.position) / self.get("PWM Limit")
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
        self.set("Realtime Tick", int(self._uptime * 1000) % 32768)

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
        self.advance(0.0)
