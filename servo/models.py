"""Dynamixel models of the X and P series: control tables, units, and what each model can do."""

import functools
import math
from collections.abc import Mapping
from dataclasses import dataclass

from dynamixel_easy_sdk.control_table import ControlTable
from dynamixel_easy_sdk.data_types import ControlTableItem

from gesture_bot.base.errors import RobotError

RPM = 2 * math.pi / 60
"""[rad/s]."""

POSITION_MODE = 3
"""Operating Mode (11): position control over one turn."""

BAUD_RATES = {
    0: 9_600, 1: 57_600, 2: 115_200, 3: 1_000_000, 4: 2_000_000, 5: 3_000_000, 6: 4_000_000, 7: 4_500_000,
}  # fmt: skip
"""What Baud Rate (8) means [bit/s]. A servo comes from the factory with 57600 and the ID 1."""

WATCHDOG_UNIT = 0.02
"""Unit of Bus Watchdog (98) [s]."""

WATCHDOG_ERROR = 0xFF
"""Bus Watchdog (98) reads -1 after it has stopped the servo."""

HARDWARE_ERRORS = {
    0: "input voltage", 1: "motor hall sensor", 2: "overheating", 3: "motor encoder",
    4: "electrical shock", 5: "overload",
}  # fmt: skip
"""Bits of Hardware Error Status (70)."""


@dataclass(frozen=True)
class Series:
    """What the models of a series have in common. Addresses in docstrings and comments are the X series'.

    Attributes:
        name: As in "Dynamixel X".
        typical: Model Number (0) of one that has all the registers which the driver uses.
        ram: First address of the RAM; EEPROM registers, below, can be written only while torque is off.
        velocity_unit: Unit of Present Velocity (128) and Profile Velocity (112) [rad/s].
        acceleration_unit: Unit of Profile Acceleration (108) [rad/s^2].
        watchdog_firmware: The first firmware with Bus Watchdog (98).
    """

    name: str
    typical: int
    ram: int
    velocity_unit: float
    acceleration_unit: float
    watchdog_firmware: int

    @functools.cached_property
    def registers(self) -> Mapping[str, ControlTableItem]:
        """Registers that the driver uses; in all models of the series they lie at the same address.

        Present Load is where other models have Present Current.
        """
        return table_of(self.typical)


X = Series("X", 1060, 64, 0.229 * RPM, 214.577 * RPM / 60, 38)
P = Series("P", 2020, 512, 0.01 * RPM, RPM / 60, 0)
SERIES = (X, P)


@dataclass(frozen=True)
class Model:
    """A servo model, from its page in the ROBOTIS e-Manual (emanual.robotis.com/docs/en/dxl/SERIES/NAME).

    Attributes:
        number: Model Number (0).
        speed: No-load speed at `voltage` [rev/min].
        torque: Stall torque at `voltage`; of the P series the continuous torque [N m].
        current: Current at that torque [A].
        voltage: [V].
        current_unit: Unit of Present Current (126) [A]; 0 where 126 is Present Load, in 0.1% of the largest.
        series: X or P.
        turn: Ticks of a turn: unit of Goal Position (116) and Present Position (132).
        centre: Position at which the servo angle is zero, in the middle of the turn [ticks].
    """

    number: int
    speed: float
    torque: float
    current: float
    voltage: float
    current_unit: float
    series: Series = X
    turn: int = 4096
    centre: int = 2048

    @property
    def effort_unit(self) -> float:
        """Unit of register 126 [N m], taking the torque as proportional to the current."""
        return (
            0.001 * self.torque if self.current_unit == 0 else self.torque * self.current_unit / self.current
        )

    @property
    def ticks_per_radian(self) -> float:
        """How many ticks a radian has."""
        return self.turn / (2 * math.pi)

    @property
    def first(self) -> int:
        """First position of the turn that position control has [ticks]."""
        return self.centre - self.turn // 2

    @property
    def last(self) -> int:
        """Last position of that turn [ticks]."""
        return self.first + self.turn - 1

    @property
    def homing_range(self) -> int:
        """Homing Offset (20) counts up to here, 90 degrees, in position control [ticks]; more is ignored."""
        return self.turn // 4

    @property
    def table(self) -> dict[str, ControlTableItem]:
        """Address and size of each register by name."""
        return table_of(self.number)

    def ticks(self, angle: float) -> int:
        """Position [ticks] at a servo angle [rad]."""
        return round(self.centre + self.ticks_per_radian * angle)


def _p(number: int, speed: float, torque: float, current: float, turn: int) -> Model:
    return Model(number, speed, torque, current, 24, 0.001, P, turn, 0)


MODELS = {
    "XL330-M077": Model(1190, 383, 0.215, 1.47, 5, 0.001),
    "XL330-M288": Model(1200, 103, 0.52, 1.47, 5, 0.001),
    "XL430-W250": Model(1060, 61, 1.5, 1.4, 12, 0),
    "XC430-W150": Model(1070, 106, 1.6, 1.4, 12, 0),
    "XC430-W240": Model(1080, 70, 1.9, 1.4, 12, 0),
    "XM430-W210": Model(1030, 77, 3.0, 2.3, 12, 0.00269),
    "XM430-W350": Model(1020, 46, 4.1, 2.3, 12, 0.00269),
    "XM540-W150": Model(1130, 53, 7.3, 4.4, 12, 0.00269),
    "XM540-W270": Model(1120, 30, 10.6, 4.4, 12, 0.00269),
    "XH430-W210": Model(1010, 50, 2.5, 1.3, 12, 0.00269),
    "XH430-W350": Model(1000, 30, 3.4, 1.3, 12, 0.00269),
    "PM42-010-S260": _p(2100, 28.0, 1.7, 0.6, 526_374),
    "PM54-040-S250": _p(2110, 28.4, 3.9, 1.9, 502_834),
    "PM54-060-S250": _p(2120, 33.1, 10.1, 3.0, 502_834),
    "PH42-020-S300": _p(2000, 32.7, 5.1, 1.5, 607_500),
    "PH54-100-S500": _p(2010, 33.3, 25.3, 5.5, 1_003_846),
    "PH54-200-S500": _p(2020, 33.1, 44.7, 9.3, 1_003_846),
}


def table_of(number: int) -> dict[str, ControlTableItem]:
    """Address and size of each register of a model by name, as the DynamixelSDK lists them for its number."""
    same = {"Secondary ID": "Secondary(Shadow) ID"}
    table = {same.get(name, name): item for name, item in ControlTable.getControlTable(number).items()}
    return {"Present Load": table["Present Current"], **table} if "Present Current" in table else table


def find_model(name: str) -> Model:
    """The model with a name as it stands on the servo, like XM430-W350.

    Raises:
        RobotError: The model is not known; lists the known ones.
    """
    if name not in MODELS:
        raise RobotError("unknown servo model", name, MODELS)
    return MODELS[name]


def model_name(number: int) -> str:
    """Name of the model with a Model Number (0), or the number itself."""
    return next((name for name, model in MODELS.items() if model.number == number), f"model number {number}")


def series_with(number: int | None) -> Series:
    """The series of the model with a Model Number (0); X where it is not known."""
    return next((model.series for model in MODELS.values() if model.number == number), X)


def signed(value: int, size: int) -> int:
    """A register's bytes as a two's complement number."""
    return value - (1 << 8 * size) if value >> (8 * size - 1) else value
