"""The moments of a bus cycle: ticks jitter, threads pause, and the clock on the wall may be set."""

import math


class Pacing:
    """Follows the ticks of a driver.

    Args:
        dt: Time from one tick to the next, as agreed [s].

    Attributes:
        sampled: The moment of the plan that is sent now [s since the epoch]. It goes in even steps.
        late: How many ticks came more than half a period late.
    """

    def __init__(self, dt: float):
        self.sampled = -math.inf
        self.late = 0
        self._dt = dt
        self._last = -math.inf
        self._ahead = -math.inf

    def tick(self, now: float, since: float, until: float) -> None:
        """It was `now` [s since the epoch] at a moment between two of the monotonic clock [s]."""
        # The thread may have paused between them for any time: what fits them is not changed.
        self._ahead = min(max(self._ahead, now - until), now - since)
        self.late += math.inf > now - self._last > 1.5 * self._dt
        self._last = now
        # The plan is sampled at even steps that follow the clock slowly.
        due = self.sampled + self._dt
        self.sampled = due + 0.02 * (now - due) if abs(now - due) < self._dt else now

    def stamp(self, monotonic: float) -> float:
        """A moment on the monotonic clock [s], in seconds since the epoch."""
        return monotonic + self._ahead
