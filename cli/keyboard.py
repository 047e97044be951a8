"""Keys one by one, as they are pressed, and a terminal that is afterwards what it was before."""

import os
import re
import select
import signal
import sys
import termios
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

from gesture_bot.base.errors import GestureBotError

_NAMES = {
    "\x1b[A": "up", "\x1b[B": "down", "\x1b[C": "right", "\x1b[D": "left",
    "\x1bOA": "up", "\x1bOB": "down", "\x1bOC": "right", "\x1bOD": "left",
    "\x1b[1;2C": "shift-right", "\x1b[1;2D": "shift-left",
    "\r": "enter", "\n": "enter", " ": "space",
}  # fmt: skip
"""What terminals send (ECMA-48; xterm's modified keys)."""

_KEY = re.compile(r"\x1b(?:\[[0-9;]*|O)[A-Za-z~]|[^\x1b]")


@contextmanager
def keyboard() -> Iterator[Callable[[], list[str]]]:
    """Keys of the terminal on standard input, without Enter and without echo, until the block ends.

    However it ends, by SIGTERM or a closed window too, the terminal is then as before. Ctrl-C interrupts as
    ever. Ctrl-Z does nothing: it would leave the terminal as it is here.

    Yields:
        A function that returns the keys pressed since its last call: characters, or the names up, down,
        left, right, shift-left, shift-right, enter and space.

    Raises:
        GestureBotError: Standard input is no terminal.
    """
    if not sys.stdin.isatty():
        raise GestureBotError("this needs a terminal, to read keys from: standard input is none")
    terminal = sys.stdin.fileno()
    before = termios.tcgetattr(terminal)
    handlers = {number: signal.signal(number, _end) for number in (signal.SIGTERM, signal.SIGHUP)}
    try:
        tty.setcbreak(terminal)
        mode = termios.tcgetattr(terminal)
        mode[6][termios.VSUSP] = b"\0"
        termios.tcsetattr(terminal, termios.TCSANOW, mode)
        yield _Keys(terminal)
    finally:
        termios.tcsetattr(terminal, termios.TCSAFLUSH, before)
        for number, handler in handlers.items():
            signal.signal(number, handler)


def _end(number: int, _frame: FrameType | None) -> None:
    raise SystemExit(128 + number)


class _Keys:
    def __init__(self, terminal: int):
        self._terminal = terminal
        self._rest = b""

    def __call__(self) -> list[str]:
        while select.select([self._terminal], [], [], 0)[0]:
            read = os.read(self._terminal, 1024)
            if not read:
                raise GestureBotError("the terminal is gone")
            self._rest += read
        text = self._rest.decode(errors="replace")
        keys = list(_KEY.finditer(text))
        # The beginning of an arrow key may come before its end.
        left = text[keys[-1].end() :] if keys else text
        self._rest = left.encode()[-16:]
        return [_NAMES.get(key.group(), key.group()) for key in keys]
