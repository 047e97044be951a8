"""Giving a servo another ID, or another baud rate."""

from contextlib import closing

from gesture_bot.base.errors import BusError, InvalidValueError
from gesture_bot.servo.bus import Bus
from gesture_bot.servo.models import BAUD_RATES, series_with
from gesture_bot.servo.scan import LIKELY, SHARED

LARGEST_ID = 252


def check_new_address(new: int, baudrate: int) -> None:
    """See that a servo can have this ID and speak at this baud rate [bit/s].

    Raises:
        InvalidValueError: It cannot.
    """
    if not 0 <= new <= LARGEST_ID:
        raise InvalidValueError("no servo can have the ID", new, [f"0 to {LARGEST_ID}"])
    if baudrate not in LIKELY:
        raise InvalidValueError("no servo speaks at this baud rate", baudrate, sorted(LIKELY))


def check_free(bus: Bus, servo_id: int) -> None:
    """See that no servo has an ID.

    Raises:
        BusError: One has.
    """
    if bus.ping(servo_id) is not None:
        raise BusError(f"another servo on {bus.port} has the ID", servo_id)


def check_alone(bus: Bus, servo_id: int) -> None:
    """See that one servo, and no more, answers to an ID, and speak to its series from now on.

    Raises:
        BusError: None does, or its answers are damaged, as those of two are.
    """
    number = bus.ping(servo_id)
    if number is None and servo_id not in (found := bus.scan()):
        raise BusError(f"no servo answers on {bus.port} at ID", servo_id, found or ["no servo at all"])
    if not bus.is_clear(servo_id):
        raise BusError(f"servo {servo_id} on {bus.port}: {SHARED}")
    bus.registers = series_with(number).registers


def change_id(bus: Bus, old: int, new: int) -> None:
    """Give a servo another ID. It keeps it without power.

    Raises:
        BusError: It does not answer, or refuses, as it does while torque is on.
    """
    try:
        bus.write(old, "ID", new)
    except BusError:
        # Its answer may have been lost, and then nobody has heard the next attempts.
        if bus.ping(new) is None:
            raise


def change_baudrate(bus: Bus, servo_id: int, baudrate: int) -> None:
    """Let a servo speak at another baud rate [bit/s] from now on. It closes the bus.

    Raises:
        BusError: It refuses, as it does while torque is on, or does not answer at the new baud rate.
    """
    value = next(value for value, rate in BAUD_RATES.items() if rate == baudrate)
    refusal = None
    with closing(bus):
        try:
            bus.write(servo_id, "Baud Rate", value)
        except BusError as error:
            refusal = error
    with closing(Bus(bus.port, baudrate)) as faster:
        if faster.ping(servo_id) is None:
            raise refusal or BusError(
                f"servo {servo_id} does not answer after it was set to [bit/s]", baudrate
            )
