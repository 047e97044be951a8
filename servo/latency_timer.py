"""The latency timer of USB serial adapters with an FTDI chip: how long one keeps bytes back."""

from contextlib import suppress
from pathlib import Path

from serial import Serial

DEVICES = Path("/sys/bus/usb-serial/devices")
"""Where Linux shows the timers."""

SHORTEST = 1
"""Least value [ms]; a new adapter has 16, more than a bus cycle."""


def shorten(serial: Serial) -> int | None:
    """Ask for the shortest latency; returns what the timer is then [ms], None for a port without one."""
    with suppress(ValueError, AttributeError):  # a port without one refuses; only Linux has the call
        serial.set_low_latency_mode(True)
    return latency(serial.port)


def latency(port: str) -> int | None:
    """What the timer of a port is [ms], None for a port without one."""
    timer = DEVICES / Path(port).resolve().name / "latency_timer"
    try:
        return int(timer.read_text())
    except (OSError, ValueError):
        return None
