"""The semantic bank as buttons."""

from collections.abc import Iterable
from functools import partial

import viser

from gesture_bot.studio.events import Events
from gesture_bot.studio.steering import Steering

STYLE = """
div:has(> div > .studio-chips) { display: flex; flex-wrap: wrap; padding: 4px; }
div:has(> div > .studio-chips) > div { margin-inline: 2px !important; padding-bottom: 5px !important; }
div:has(> div > .studio-chips) button { padding-inline: 9px; }
"""


class GestureButtons:
    """A button for each gesture.

    Args:
        server: The page's server.
        tab: Where they stand.
        events: Takes in what people do.
        steering: Passes it on.
    """

    def __init__(
        self, server: viser.ViserServer, tab: viser.GuiTabHandle, events: Events, steering: Steering
    ):
        self._server, self._tab, self._events, self._steering = server, tab, events, steering
        self._buttons: dict[str, viser.GuiButtonHandle] = {}
        with tab:
            server.gui.add_html('<div class="studio-chips"></div>')

    def show(self, gestures: Iterable[str]) -> None:
        """Show the gestures of the bank as it is now, in its order."""
        names = list(gestures)
        if names == list(self._buttons):
            return
        for button in self._buttons.values():
            button.remove()
        self._buttons = {}
        with self._tab:
            for name in names:
                self._buttons[name] = self._server.gui.add_button(name.replace("_", " "), color="gray")
                self._buttons[name].on_click(self._events.on(f"gesture {name}", partial(self._make, name)))

    def _make(self, gesture: str, _value: object) -> None:
        self._steering.make(gesture)
