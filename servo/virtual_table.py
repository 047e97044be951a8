"""The control table of a virtual servo, by the e-Manual's rules."""

from collections.abc import Mapping

from dynamixel_easy_sdk.data_types import ControlTableItem
from dynamixel_sdk.protocol2_packet_handler import (
    ERRNUM_ACCESS,
    ERRNUM_DATA_LENGTH,
    ERRNUM_DATA_LIMIT,
    ERRNUM_DATA_RANGE,
)

from gesture_bot.servo.models import POSITION_MODE, WATCHDOG_ERROR, Model, P, X

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
"""Smallest and largest value that each writable register takes in any model of the X series; all others are
read-only."""

INITIAL = {
    "Firmware Version": 48, "Baud Rate": 3, "Return Delay Time": 250, "Operating Mode": POSITION_MODE,
    "Secondary(Shadow) ID": 255, "Protocol Type": 2, "Moving Threshold": 10, "Temperature Limit": 72,
    "Max Voltage Limit": 140, "Min Voltage Limit": 60, "PWM Limit": 885, "Current Limit": 1193,
    "Max Position Limit": 4095, "Shutdown": 52, "Status Return Level": 2, "Velocity I Gain": 1000,
    "Velocity P Gain": 100, "Position P Gain": 640, "Goal PWM": 885, "Goal Current": 1193,
}  # fmt: skip
"""What any virtual servo holds at first, where that is not zero: the e-Manual's values for an XL430-W250, but
for the baud rate and the current limit."""

P_WRITABLE = WRITABLE | {
    "Baud Rate": (0, 9), "Homing Offset": (-(1 << 31), (1 << 31) - 1), "Moving Threshold": (0, 2920),
    "Max Voltage Limit": (150, 350), "Min Voltage Limit": (150, 350), "PWM Limit": (0, 2009),
    "Current Limit": (0, 22740), "Acceleration Limit": (0, 4346756), "Velocity Limit": (0, 2920),
    "Max Position Limit": (-501923, 501923), "Min Position Limit": (-501923, 501923),
    "LED Red": (0, 255), "LED Green": (0, 255), "LED Blue": (0, 255), "Velocity I Gain": (0, 32767),
    "Velocity P Gain": (0, 32767), "Position D Gain": (0, 32767), "Position I Gain": (0, 32767),
    "Position P Gain": (0, 32767), "Feedforward 2nd Gain": (0, 32767), "Feedforward 1st Gain": (0, 32767),
    "Goal PWM": (-2009, 2009), "Goal Current": (-22740, 22740), "Goal Velocity": (-2920, 2920),
    "Profile Acceleration": (0, 4346756), "Profile Velocity": (0, 2920),
    "Goal Position": (-(1 << 31), (1 << 31) - 1),
}  # fmt: skip

P_INITIAL = INITIAL | {
    "Moving Threshold": 20, "Temperature Limit": 80, "Max Voltage Limit": 350, "Min Voltage Limit": 150,
    "PWM Limit": 2009, "Current Limit": 22740, "Acceleration Limit": 3992644, "Velocity Limit": 2900,
    "Velocity I Gain": 2209, "Velocity P Gain": 6153, "Position P Gain": 314, "Goal PWM": 2009,
    "Goal Current": 22740,
}  # fmt: skip
"""The e-Manual's values for a PH54-200-S500, but for the baud rate."""

LAYOUT = {
    X: (WRITABLE, INITIAL, ((168, 224, 28), (578, 634, 28))),
    P: (P_WRITABLE, P_INITIAL, ((168, 634, 128),)),
}
"""By series: both tables above, and where Indirect Address and Indirect Data begin, and how many there are.
An XL330 has the first block alone."""

GOALS = ("Goal PWM", "Goal Current", "Goal Velocity", "Goal Position")


class VirtualTable:
    """Registers that can be read and written as by packets, and by their names.

    Args:
        model: Whose control table it is.

    Attributes:
        model: The same.
        memory: The control table, byte by byte.
    """

    def __init__(self, model: Model):
        self.model = model
        self.memory = bytearray(1024)
        limits, initial, blocks = LAYOUT[model.series]
        self._table, self._limits, self._initial = dict(model.table), dict(limits), dict(initial)
        self._pointers: dict[int, int] = {}
        self._add_indirect(blocks)
        self._first_indirect = min(self._pointers, default=len(self.memory))
        self._names = {item.address: name for name, item in self._table.items() if name in self._limits}
        # Registers are looked up some thousand times a second.
        self._places = {
            name: (slice(item.address, item.address + item.size), self._limits.get(name, (0, 0))[0] < 0)
            for name, item in self._table.items()
        }

    @property
    def homing(self) -> int:
        """What is added to the position in all registers [ticks]; too large an offset is ignored."""
        offset = self.get("Homing Offset")
        counts = abs(offset) <= self.model.homing_range or self.get("Operating Mode") != POSITION_MODE
        return offset if counts else 0

    def get(self, name: str) -> int:
        """The value of a register."""
        place, signed = self._places[name]
        return int.from_bytes(self.memory[place], "little", signed=signed)

    def set(self, name: str, value: int) -> None:
        """Set a register, also one that a packet may not write."""
        place, _ = self._places[name]
        size = place.stop - place.start
        self.memory[place] = (value % (1 << 8 * size)).to_bytes(size, "little")

    def read(self, address: int, size: int) -> bytes:
        """Some bytes of the control table; where no register lies, they are zero."""
        end = min(address + size, len(self.memory))
        if end <= self._first_indirect:
            return bytes(self.memory[address:end])
        return bytes(self.memory[self._target(at)] for at in range(address, end))

    def write(self, address: int, data: bytes) -> int:
        """Write registers that lie side by side, all or none, and return the status packet's error number."""
        values = {}
        targets = [self._target(at) for at in range(address, address + len(data))]
        while data:
            name = self._names.get(targets[0])
            if name is None or (targets[0] < self.model.series.ram and self.get("Torque Enable")):
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
        return 0

    def _reset(self, first_address: int, own: Mapping[str, int]) -> None:
        """Let registers from an address on hold what they hold at first; `own` is what this servo holds."""
        for name, item in self._table.items():
            if item.address >= first_address:
                self.set(name, own.get(name, self._initial.get(name, 0)))

    def _target(self, address: int) -> int:
        """Where a byte really lies: an Indirect Data is where its Indirect Address says."""
        pointer = self._pointers.get(address)
        return address if pointer is None else int.from_bytes(self.memory[pointer : pointer + 2], "little")

    def _add_indirect(self, blocks: tuple[tuple[int, int, int], ...]) -> None:
        """Put all Indirect Addresses and Data in the table; the SDK lists the first of each block."""
        known, number = {item.address for item in self._table.values()}, 0
        self._table = {name: item for name, item in self._table.items() if not name.startswith("Indirect")}
        blocks = tuple(block for block in blocks if block[0] in known)
        reach = self.model.series.ram, max(data + count - 1 for _, data, count in blocks)
        for pointers, data, count in blocks:
            for at in range(count):
                number += 1
                pointer, byte = f"Indirect Address {number}", f"Indirect Data {number}"
                self._table[pointer] = ControlTableItem(pointers + 2 * at, 2)
                self._table[byte] = ControlTableItem(data + at, 1)
                self._limits |= {pointer: reach, byte: (0, 255)}
                self._initial[pointer] = data + at  # it is a byte of its own
                self._pointers[data + at] = pointers + 2 * at
