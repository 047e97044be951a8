"""Reading where all servos are, although one or the other may not answer."""

from collections import deque

import numpy as np

from gesture_bot.base.errors import BusError
from gesture_bot.servo.bus import ATTEMPTS, Bus
from gesture_bot.servo.buses import RobotBus
from gesture_bot.servo.table import PRESENT

SILENT_AFTER = 8
"""A servo that has been asked in vain in so many cycles is silent, and no longer asked in each cycle."""

ALONE_AFTER = 2
"""After so many, it is asked alone: those behind it in a common question may wait for its answer in vain."""

STAMP_ERROR = 0.004
"""How far the moment of a reading may be off [s].

A servo measures when the question reaches it, somewhere between question and answer. A computer or a servo
that is busy for longer than this leaves that open.
"""

HANGS = 0.5
"""A line on which nobody answers for less than this only hung [s]: the computer, an adapter or a virtual bus
was busy, and its servos need not be set up again."""

RETRY_TIME = 0.004
"""Time in a cycle for asking those alone that have not answered [s]; who is left waits for the next cycle."""

PLAIN_CYCLES = 100
"""After a Fast Sync Read has failed, so many cycles use Sync Read: noise then costs single answers alone."""

_LATELY = 100  # readings, the quickest of which says how long one takes


class PresentReader:
    """Reads the present state of the servos once a cycle.

    All are asked in one transaction. Who does not answer is asked alone, once, while there is time.

    Args:
        bus: The bus, or all of them.
        ids: The servos, in joint order.

    Attributes:
        present: (j,) PRESENT records, each as it was last heard.
        fresh: (j,) who was heard in the last cycle.
        read_at: When they were last asked, on the monotonic clock [s]; they measure then.
        prompt: Whether the last reading was as quick as the quickest lately, so that its moment is known
            within 4 ms.
        late: Readings that took longer, so far.
        failures: Answers that did not come in time, or were damaged, so far.
    """

    def __init__(self, bus: RobotBus, ids: list[int]):
        self.present = np.zeros(len(ids), PRESENT)
        self.fresh = np.zeros(len(ids), bool)
        self.read_at = 0.0
        self.prompt = True
        self.late = 0
        self.failures = 0
        self._bus = bus
        self._ids = ids
        self._missed = dict.fromkeys(ids, 0)
        self._lines = {servo_id: bus.of(servo_id) for servo_id in ids}
        self._answered_at = dict.fromkeys(self._lines.values(), -np.inf)
        self._hanging: set[Bus] = set()
        self._took: deque[float] = deque(maxlen=_LATELY)
        self._plain = 0
        self._turn = 0
        # Firmware without Fast Sync Read leaves the question without an answer.
        self._fast = any(len(self._ask(ids, fast=True)) == len(ids) for _ in range(2))

    @property
    def silent(self) -> list[int]:
        """IDs of the servos that have stopped answering."""
        return [servo_id for servo_id, missed in self._missed.items() if missed >= SILENT_AFTER]

    def read(self) -> None:
        """Bring `present` up to date."""
        silent = [servo_id for servo_id in self.silent if self._lines[servo_id] not in self._hanging]
        asked = [servo_id for servo_id in self._ids if servo_id not in silent]
        together = [servo_id for servo_id in asked if self._missed[servo_id] < ALONE_AFTER]
        fast = self._fast and not self._plain
        self._plain = max(self._plain - 1, 0)
        answers = self._ask(together, fast)
        self.read_at = self._bus.asked_at
        missing = self._in_turn(set(asked) - set(answers))
        if missing:
            self.failures += 1
            self._plain = PLAIN_CYCLES
            until = self._bus.clock.monotonic() + RETRY_TIME
            for servo_id in missing:
                if self._bus.clock.monotonic() > until:
                    break
                answers |= self._ask([servo_id], fast=False)
        self.fresh[:] = [servo_id in answers for servo_id in self._ids]
        for servo_id in asked:
            if servo_id in answers:
                self._missed[servo_id] = 0
                self.present[self._ids.index(servo_id)] = np.frombuffer(answers[servo_id], PRESENT)[0]
            else:
                self._missed[servo_id] += 1
        now = self._bus.clock.monotonic()
        self._see_who_hangs({self._lines[servo_id] for servo_id in answers}, now)
        self._judge(now - self.read_at)

    def read_all(self) -> None:
        """Bring all of `present` up to date, in a few attempts.

        Raises:
            BusError: A servo does not answer.
        """
        missing = set(self._ids)
        for _ in range(ATTEMPTS):
            self.read()
            missing -= {servo_id for servo_id, fresh in zip(self._ids, self.fresh, strict=True) if fresh}
            if not missing:
                return
        raise BusError(f"servos on {self._bus.port} stopped answering, IDs", sorted(missing))

    def _ask(self, ids: list[int], fast: bool) -> dict[int, bytes]:
        return self._bus.sync_read(ids, "Present Load", PRESENT.itemsize, fast)

    def _in_turn(self, missing: set[int]) -> list[int]:
        """The one first that has been missed longest. Of equals another each time: one may be gone."""
        self._turn += 1
        turns = {servo_id: (at - self._turn) % len(self._ids) for at, servo_id in enumerate(self._ids)}
        return sorted(missing, key=lambda servo_id: (-self._missed[servo_id], turns[servo_id]))

    def heard(self, servo_id: int) -> None:
        """A servo that was silent has answered."""
        self._missed[servo_id] = 0

    def _see_who_hangs(self, answering: set[Bus], now: float) -> None:
        """Let the servos of lines that hung until now be asked together again, and see which hang."""
        for servo_id, line in self._lines.items():
            if line in answering & self._hanging:
                self._missed[servo_id] = 0
        self._answered_at |= dict.fromkeys(answering, now)
        self._hanging = {
            line for line, at in self._answered_at.items() if line not in answering and now - at < HANGS
        }

    def _judge(self, took: float) -> None:
        self._took.append(took)
        self.prompt = took < min(self._took) + STAMP_ERROR
        self.late += not self.prompt
