"""The Dynamixel X series: control table, units, and what each model can do."""

import math
from dataclasses import dataclass

from dynamixel_easy_sdk.control_table import ControlTable
from dynamixel_easy_sdk.data_types import ControlTableItem

from gesture_bot.base.errors import RobotError

TICKS_PER_RADIAN = 4096 / (2 * math.pi)
"""Unit of Goal Position (116) and Present Position (132)."""

CENTRE = 2048
"""Position [ticks] at which the servo angle is zero."""

VELOCITY_UNIT = 0.229 * 2 * math.pi / 60
"""Unit of Present Velocity (128) and Profile Velocity (112) [rad/s]."""

ACCELERATION_UNIT = 214.577 * 2 * math.pi / 3600
"""Unit of Profile Acceleration (108) [rad/s^2]."""

POSITION_MODE = 3
"""Operating Mode (11): position control over one turn."""

HOMING_RANGE = 1024
"""Homing Offset (20) counts up to here in position control [ticks]; the servo ignores a larger one."""

BAUD_RATES = {
    0: 9_600, 1: 57_600, 2: 115_200, 3: 1_000_000, 4: 2_000_000, 5: 3_000_000, 6: 4_000_000, 7: 4_500_000,
}  # fmt: skip
"""What Baud Rate (8) means [bit/s]. A servo comes from the factory with 57600 and the ID 1."""

WATCHDOG_UNIT = 0.02
"""Unit of Bus Watchdog (98) [s]."""

WATCHDOG_ERROR = 0xFF
"""Bus Watchdog (98) reads -1 after it has stopped the servo."""

HARDWARE_ERRORS = {
    0: "input voltage", 2: "overheating", 3: "motor encoder", 4: "electrical shock", 5: "overload",
}  # fmt: skip
"""Bits of Hardware Error Status (70)."""


@dataclass(frozen=True)
class Model:
    """A servo model, from its page in the ROBOTIS e-Manual (emanual.robotis.com/docs/en/dxl/x/NAME).

    Attributes:
        number: Model Number (0).
        speed: No-load speed at `voltage` [rev/min].
        torque: Stall torque at `voltage` [N m].
        current: Current at that torque [A].
        voltage: [V].
        current_unit: Unit of Present Current (126) [A]; 0 where 126 is Present Load, in 0.1% of the largest.
    """

    number: int
    speed: float
    torque: float
    current: float
    voltage: float
    current_unit: float

    @property
    def effort_unit(self) -> float:
        """Unit of register 126 [N m], taking the torque as proportional to the current."""
        return (
            0.001 * self.torque if self.current_unit == 0 else self.torque * self.current_unit / self.current
        )

    @property
    def table(self) -> dict[str, ControlTableItem]:
        """Address and size of each register by name, as the DynamixelSDK lists them."""
        return ControlTable.getControlTable(self.number)


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
}

REGISTERS = MODELS["XL430-W250"].table
"""Registers that the driver uses; they lie at the same address in every model above."""


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


def signed(value: int, size: int) -> int:
    """A register's bytes as a two's complement number."""
    return value - (1 << 8 * size) if value >> (8 * size - 1) else value
