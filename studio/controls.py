"""The motion controls: a range for each quantity, in its unit and in percentiles of the database."""

from html import escape

import numpy as np
import viser

from gesture_bot.matching.controls import Bound, Constraint, Controls, Hand
from gesture_bot.matching.quantities import QUANTITIES, TWO_HANDED, UNITS, Quantity
from gesture_bot.studio.events import Events
from gesture_bot.studio.steering import Steering

PERCENTILES = np.linspace(0, 100, 41)
"""At which the database's distribution is read."""

STEP = 0.01
"""Of a slider [m, m/s]."""

STYLE = ".studio-range { margin: -6px 10px 6px; font-size: 11px; color: #6b7580; text-align: right; }"


class _Range:
    """A slider with two ends; one that is at the end of the scale bounds nothing."""

    def __init__(self, server: viser.ViserServer, controls: Controls, quantity: Quantity, hand: Hand):
        self._quantity, self._hand = quantity, hand
        # A bound of either side has a distribution of its own; for one hand, they are the same.
        self._scale = np.array(
            [controls.threshold(Constraint(quantity, "at_least", p, hand)) for p in PERCENTILES]
        )
        low, high = np.floor(self._scale[0] / STEP) * STEP, np.ceil(self._scale[-1] / STEP) * STEP
        self._ends = round(float(low), 2), round(float(high), 2)
        name = quantity.replace("_", " ") + ("" if hand == "both" else f", {hand}")
        self.slider = server.gui.add_multi_slider(
            name, min=self._ends[0], max=self._ends[1], step=STEP, initial_value=self._ends, min_range=STEP
        )
        self._words = server.gui.add_html("")
        self.describe()

    def free(self) -> None:
        """Bound nothing."""
        self.slider.value = self._ends
        self.describe()

    def constraints(self) -> list[Constraint]:
        """The bounds that the slider stands for."""
        bounds: tuple[Bound, Bound] = ("at_least", "at_most")
        return [
            Constraint(self._quantity, bound, value, self._hand, "value")
            for bound, value, end in zip(bounds, self.slider.value, self._ends, strict=True)
            if abs(value - end) > STEP / 2
        ]

    def describe(self) -> None:
        """Say the bounds in words."""
        unit = UNITS[self._quantity]
        sides = {"at_least": "≥", "at_most": "≤"}
        words = [
            f"{sides[bound.bound]} {bound.value:.2f} {unit} (percentile {self._percentile(bound.value):.0f})"
            for bound in self.constraints()
        ]
        free = f"free: {self._ends[0]:.2f} to {self._ends[1]:.2f} {unit}"
        self._words.content = f'<div class="studio-range">{escape(" and ".join(words) or free)}</div>'

    def _percentile(self, value: float) -> float:
        return float(np.interp(value, self._scale, PERCENTILES))


class ControlSliders:
    """The ranges of all quantities.

    Args:
        server: The page's server.
        controls: Of the database.
        events: Takes in what people do.
        steering: Passes it on.
    """

    def __init__(self, server: viser.ViserServer, controls: Controls, events: Events, steering: Steering):
        self._steering = steering
        both: tuple[Hand, ...] = ("both",)
        each: tuple[Hand, ...] = ("left", "right")
        self._ranges = [
            _Range(server, controls, quantity, hand)
            for quantity in QUANTITIES
            for hand in (both if quantity in TWO_HANDED else each)
        ]
        for one in self._ranges:
            one.slider.on_update(events.on("controls", lambda _value: self._send()))
        button = server.gui.add_button("Free the motion", color="gray")
        button.on_click(events.on("controls", lambda _value: self._free()))

    def _free(self) -> None:
        for one in self._ranges:
            one.free()
        self._send()

    def _send(self) -> None:
        for one in self._ranges:
            one.describe()
        self._steering.constrain([constraint for one in self._ranges for constraint in one.constraints()])
