"""What people do on the page, handed over from the web server's thread to the one that runs the node."""

import time
from collections.abc import Callable
from typing import Any

from gesture_bot.base.errors import GestureBotError

SETTLED = 1.0
"""What people asked for is in force, or refused, after so long [s]."""


class Events:
    """Keeps the newest event of each element until it is dealt with: a slider that is dragged sends many."""

    def __init__(self) -> None:
        self._waiting: dict[str, Callable[[], None]] = {}
        self._put_at: dict[str, float] = {}

    @property
    def waiting(self) -> bool:
        """Whether there is something to do."""
        return bool(self._waiting)

    def put(self, key: str, act: Callable[[], None]) -> None:
        """Let something be done at the next `deal`, in place of what waits under the same key."""
        self._waiting[key] = act
        self._put_at[key] = time.monotonic()

    def settled(self, *keys: str) -> bool:
        """Whether nothing happened lately under some keys: their elements may show what is in force."""
        return all(time.monotonic() - self._put_at.get(key, -SETTLED) >= SETTLED for key in keys)

    def on(self, key: str, act: Callable[[Any], None]) -> Callable[[Any], Any]:
        """A callback for an element of viser: what its value is changed to in a browser is acted on.

        It is a coroutine, since viser calls those in the order of the events. What this program writes into
        an element is no event.
        """

        async def callback(event: Any) -> None:
            if event.client_id is not None:
                value = event.target.value
                self.put(key, lambda: act(value))

        return callback

    def deal(self) -> str:
        """Do what waits; what went wrong, in words, or nothing."""
        troubles = []
        while self._waiting:
            act = self._waiting.pop(next(iter(self._waiting)))
            try:
                act()
            except GestureBotError as error:
                troubles.append(str(error))
        return "; ".join(troubles)
