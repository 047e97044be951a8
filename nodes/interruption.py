"""How a process is told to end: by Ctrl-C, or by SIGTERM from whatever started it."""

import signal
from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Interruption:
    """Raises KeyboardInterrupt in the main thread at the first signal, and ignores all behind it.

    A second one must not leave the arms on their way to rest; `ros2 launch` always sends two.

    Attributes:
        held: Whether the interruption waits for the next `check`.
    """

    def __init__(self) -> None:
        self.held = False
        self._came = False
        for number in SIGNALS:
            signal.signal(number, self._on_signal)

    def check(self) -> None:
        """Interrupt now if a signal has come."""
        self.held = False
        if self._came:
            raise KeyboardInterrupt

    @staticmethod
    def ignore() -> None:
        """From now on, no signal interrupts."""
        for number in SIGNALS:
            signal.signal(number, signal.SIG_IGN)

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        self.ignore()
        self._came = True
        if not self.held:
            raise KeyboardInterrupt
