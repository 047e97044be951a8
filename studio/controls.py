"""The motion controls: a range for each quantity, in its unit and in percentiles of the database."""

from collections.abc import Sequence
from functools import partial
from html import escape

import numpy as np
import viser

from gesture_bot.matching.controls import Bound, Constraint, Controls, Demand, Hand
from gesture_bot.matching.quantities import QUANTITIES, TWO_HANDED, UNITS, Quantity
from gesture_bot.studio.events import Events
from gesture_bot.studio.steering import Steering

PERCENTILES = np.linspace(0, 100, 41)
"""At which the database's distribution is read."""

STEP = 0.01
"""Of a slider [m, m/s]."""

BOUNDS: dict[Bound, str] = {"at_least": "≥", "at_most": "≤"}

STYLE = """
.studio-range { margin: 4px 10px 0; font-size: 12px; font-weight: 600; color: #26303a; }
.studio-range span { float: right; font-weight: 400; font-size: 11px; color: #6b7580; }
"""


class _Range:
    """A slider for each end of a range; one that is at the end of the scale bounds nothing.

    viser's slider with two thumbs hears the mouse alone; these take keys, touch and numbers, too.
    """

    def __init__(self, server: viser.ViserServer, controls: Controls, quantity: Quantity, hand: Hand):
        self._quantity, self._hand, self._controls = quantity, hand, controls
        # A bound of either side has a distribution of its own; for one hand, they are the same.
        self._scale = np.array(
            [controls.threshold(Constraint(quantity, "at_least", p, hand)) for p in PERCENTILES]
        )
        low, high = np.floor(self._scale[0] / STEP) * STEP, np.ceil(self._scale[-1] / STEP) * STEP
        self._ends: dict[Bound, float] = {"at_least": round(float(low), 2), "at_most": round(float(high), 2)}
        self.name = quantity.replace("_", " ") + ("" if hand == "both" else f", {hand}")
        self._words = server.gui.add_html("")
        self.sliders = {
            bound: server.gui.add_slider(
                bound.replace("_", " "), self._ends["at_least"], self._ends["at_most"], STEP, end
            )
            for bound, end in self._ends.items()
        }
        self._describe()

    def follow(self, demands: Sequence[Demand]) -> None:
        """Show the bounds that some constraints set."""
        own = [
            demand
            for demand in demands
            if isinstance(demand, Constraint)
            and demand.quantity == self._quantity
            and demand.hand in (self._hand, "both")
        ]
        for bound, end in self._ends.items():
            values = [self._controls.threshold(demand) for demand in own if demand.bound == bound]
            strictest = max if bound == "at_least" else min
            self._set(bound, strictest(values, default=end))
        self._describe()

    def push(self, moved: Bound) -> None:
        """Let the other end make room for one that was moved."""
        low, high = self.sliders["at_least"].value, self.sliders["at_most"].value
        if moved == "at_least":
            self._set("at_most", max(high, low + STEP))
        else:
            self._set("at_least", min(low, high - STEP))
        self._describe()

    def constraints(self) -> list[Constraint]:
        """The bounds that the sliders stand for."""
        return [
            Constraint(self._quantity, bound, slider.value, self._hand, "value")
            for bound, slider in self.sliders.items()
            if abs(slider.value - self._ends[bound]) > STEP / 2
        ]

    def _set(self, bound: Bound, value: float) -> None:
        self.sliders[bound].value = round(min(max(value, self._ends["at_least"]), self._ends["at_most"]), 2)

    def _describe(self) -> None:
        """Say the bounds in words."""
        unit = UNITS[self._quantity]
        words = [
            f"{BOUNDS[bound.bound]} {bound.value:.2f} {unit} (percentile {self._percentile(bound.value):.0f})"
            for bound in self.constraints()
        ]
        told = " and ".join(words) or f"free [{unit}]"
        self._words.content = (
            f'<div class="studio-range">{escape(self.name)}<span>{escape(told)}</span></div>'
        )

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
        self._events, self._steering = events, steering
        self._others: list[Demand] = []
        both: tuple[Hand, ...] = ("both",)
        each: tuple[Hand, ...] = ("left", "right")
        self._ranges = [
            _Range(server, controls, quantity, hand)
            for quantity in QUANTITIES
            for hand in (both if quantity in TWO_HANDED else each)
        ]
        self._keys = ["free"]
        for one in self._ranges:
            for bound, slider in one.sliders.items():
                self._keys.append(f"{one.name} {bound}")
                slider.on_update(events.on(self._keys[-1], partial(self._move, one, bound)))
        button = server.gui.add_button("Free the motion", color="gray")
        button.on_click(events.on("free", lambda _value: self._free()))

    def show(self, demands: Sequence[Demand]) -> None:
        """Show the constraints in force, whoever set them."""
        if self._events.settled(*self._keys):
            self._others = [demand for demand in demands if not isinstance(demand, Constraint)]
            for one in self._ranges:
                one.follow(demands)

    def _move(self, one: _Range, bound: Bound, _value: float) -> None:
        one.push(bound)
        self._send()

    def _free(self) -> None:
        self._others = []
        for one in self._ranges:
            one.follow([])
        self._send()

    def _send(self) -> None:
        bounds = [constraint for one in self._ranges for constraint in one.constraints()]
        # What no slider shows, such as a choice of recordings, stays as others set it.
        self._steering.constrain([*self._others, *bounds])
