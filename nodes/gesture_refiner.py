"""Chosen windows in, one continuous motion out."""

from typing import Any

from gesture_bot.msg import GestureWindow
from gesture_bot.nodes.messages import clip_from, clip_to
from gesture_bot.nodes.node import PLAN, GestureNode, diagnostic, seconds
from gesture_bot.refine.smoothing import WindowSmoother


class GestureRefiner(GestureNode):
    """Blends windows where they meet and smooths them; no trained network takes part yet."""

    def __init__(self, name: str = "gesture_refiner", **options: Any):
        super().__init__(name, **options)
        self._smoother = WindowSmoother()
        self._windows = self._late = 0
        self._publisher = self.create_publisher(GestureWindow, "gesture/refined", PLAN)
        self.listen(GestureWindow, "gesture/selected", self._on_window, PLAN)
        self.every(1.0, self._report)
        self.waits_for("windows on gesture/selected")

    def _on_window(self, message: GestureWindow) -> None:
        refined = clip_to(self._smoother.push(clip_from(message)), message.source)
        refined.name = message.name
        self._publisher.publish(refined)
        self._windows += 1
        self._late += seconds(message.header.stamp) < self.now()

    def _report(self) -> None:
        self.diagnose(
            diagnostic("gesture refiner", self.errors(), "running", windows=self._windows, late=self._late)
        )
