"""Chosen windows and speech features in, one continuous motion out."""

from typing import Any

from gesture_bot.base.errors import GestureBotError
from gesture_bot.base.frames import KeypointClip, first_frame_after
from gesture_bot.corpus.database import SEQUENCE
from gesture_bot.corpus.demo import load_database
from gesture_bot.matching.hearing import Hearing
from gesture_bot.msg import Cut, GestureWindow, SelectorState, SpeechFeatures
from gesture_bot.nodes.constraints import bounds_from
from gesture_bot.nodes.messages import clip_from, clip_to
from gesture_bot.nodes.node import PLAN, STATE, STREAM, GestureNode, diagnostic, seconds
from gesture_bot.nodes.placing import Placing, hear
from gesture_bot.refine.model import NONE, SHIPPED, load_model
from gesture_bot.refine.smoothing import WindowSmoother
from gesture_bot.refine.streaming import NetworkRefiner


class GestureRefiner(GestureNode):
    """Refines windows with a trained network or, without one that fits, smooths them."""

    def __init__(self, name: str = "gesture_refiner", **options: Any):
        super().__init__(name, **options)
        database = self.parameter(
            "database",
            "demo",
            "Gesture database: a file, or 'demo' (built on first use)",
        )
        model = self.parameter(
            "model",
            SHIPPED,
            "Refinement network: a file of `gesture-bot train`, 'shipped' (if it fits the database), 'none'",
        )
        self._smoother = WindowSmoother()
        self._network: NetworkRefiner | None = None
        self._trouble: list[str] = []
        self._windows = self._late = 0
        self._load(model, database)
        self._publisher = self.create_publisher(GestureWindow, "gesture/refined", PLAN)
        self.listen(GestureWindow, "gesture/selected", self._on_window, PLAN)
        self.every(1.0, self._report)
        self.waits_for("windows on gesture/selected")

    def _load(self, model: str, database: str) -> None:
        try:
            # Without a network, nothing here needs the database.
            network = None if model == NONE else load_model(model, load_database(database))
        except GestureBotError as error:
            self._trouble = [f"smooths, since the model cannot be used: {error}"]
            self.get_logger().warning(self._trouble[0])
            return
        if network is None:
            self.get_logger().info(f"model {model}: windows are smoothed, no network refines them")
            return
        self._hearing, self._placing = Hearing(load_database(database)), Placing()
        self._network = NetworkRefiner(network, self._hearing)
        self.listen(SpeechFeatures, "speech/features", self._on_features, STREAM)
        self.listen(Cut, "speech/cut", self._on_cut, PLAN)
        self.listen(SelectorState, "gesture/selector_state", self._on_state, STATE)

    def _on_features(self, message: SpeechFeatures) -> None:
        placed = self._placing.place(message, self.now())
        if placed and placed[0] >= self.now():
            hear(self._hearing, message, *placed)

    def _on_cut(self, cut: Cut) -> None:
        self._hearing.cut(first_frame_after(self._placing.cut(cut)))

    def _on_state(self, state: SelectorState) -> None:
        self._placing.look_ahead = state.look_ahead

    def _on_window(self, message: GestureWindow) -> None:
        refined = clip_to(self._refined(message), message.source)
        refined.name = message.name
        self._publisher.publish(refined)
        self._windows += 1
        self._late += seconds(message.header.stamp) < self.now()

    def _refined(self, message: GestureWindow) -> KeypointClip:
        clip = clip_from(message)
        if self._network is None:
            return self._smoother.push(clip)
        self._hearing.forget(clip.start - SEQUENCE)
        return self._network.push(clip, message.source, bounds_from(message.kept))

    def _report(self) -> None:
        troubles = [*self._trouble, *self.errors()]
        refined_by = "network" if self._network else "smoothing"
        self.diagnose(
            diagnostic(
                "gesture refiner", troubles, "running",
                refined_by=refined_by, windows=self._windows, late=self._late,
            )
        )  # fmt: skip
