"""Speech features, keywords, emotion and control in; gesture windows of the database out."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, get_args

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from gesture_bot.base.errors import GestureBotError
from gesture_bot.base.frames import FRAME_RATE, KeypointClip
from gesture_bot.corpus.demo import load_database
from gesture_bot.matching.banks import WatchedBanks
from gesture_bot.matching.emotions import load_emotions
from gesture_bot.matching.search import Preselection
from gesture_bot.matching.selector import Selector, Window
from gesture_bot.msg import Control, Cut, Emotion, GestureWindow, Keyword, SelectorState, SpeechFeatures
from gesture_bot.nodes.constraints import constraint_from, constraint_to
from gesture_bot.nodes.messages import clip_to, key_values
from gesture_bot.nodes.node import PLAN, STATE, STREAM, GestureNode, seconds, stamp
from gesture_bot.speech.cuts import Cuts

try:
    from hri_msgs.msg import Expression
except ImportError:  # the package is not installed
    Expression = None


class GestureSelector(GestureNode):
    """Runs the motion matching search of MM22 against the clock, one window ahead of what is seen."""

    def __init__(self, name: str = "gesture_selector", **options: Any):
        super().__init__(name, **options)
        database = self.parameter(
            "database", "demo", "Gesture database: a file, or 'demo' (built on first use)"
        )
        banks = self.parameter("banks", "shipped", "Semantic banks: a folder of YAML files, or 'shipped'")
        emotion = self.parameter("emotion", "neutral", "Emotion at the start: a name of config/emotions.yaml")
        k = self.parameter(
            "k", 1, "Each window is drawn from so many best matches: 1 takes the best", bounds=(1, 15)
        )
        preselection = self.parameter(
            "preselection", "pose", "What is searched first (MM22)", choices=get_args(Preselection)
        )
        seed = self.parameter("seed", 0, "Seed of everything that is drawn at random")
        self._delay = self.parameter(
            "delay",
            0.0,
            "How much later than the sound the motion is made; a microphone needs 1.8 [s]",
            bounds=(0.0, 5.0),
        )
        self._banks = WatchedBanks(banks)
        self._selector = Selector(
            load_database(database),
            emotions=load_emotions(),
            gestures=self._banks.gestures,
            k=k,
            preselection=preselection,
            seed=seed,
        )
        self._selector.set_emotion(emotion)
        self._windows = self.create_publisher(GestureWindow, "gesture/selected", PLAN)
        self._states = self.create_publisher(SelectorState, "gesture/selector_state", STATE)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", PLAN)
        self._cuts = Cuts()
        self._said: tuple[Any, ...] = ()
        self._refused: dict[str, str] = {}
        self._publish_state()

        self.listen(SpeechFeatures, "speech/features", self._on_features, STREAM)
        self.listen(Keyword, "speech/keywords", self._on_keyword, PLAN)
        self.listen(Cut, "speech/cut", self._on_cut, PLAN)
        self.listen_to_state(Emotion, "emotion", self._on_emotion)
        if Expression:
            # Where the robots of PAL take the expression of their face, in the terms of REP-155.
            self.listen_to_state(Expression, "robot_face/expression", self._on_emotion)
        self.listen_to_state(Control, "control", self._on_control)
        self.every(1 / FRAME_RATE, self._plan)
        self.every(1.0, self._report)
        self.every(1.0, self._reload)
        self.waits_for("features on speech/features; rests until then")

    def _is_void(self, message: SpeechFeatures | Keyword) -> bool:
        header = message.header
        return self._cuts.void(header.frame_id, message.utterance, seconds(header.stamp))

    def _on_features(self, message: SpeechFeatures) -> None:
        if self._is_void(message):
            return
        frame = round((seconds(message.header.stamp) + self._delay) * FRAME_RATE)
        self._selector.add_features(frame, np.asarray(message.features))

    def _on_keyword(self, message: Keyword) -> None:
        if self._is_void(message):
            return
        stroke = seconds(message.header.stamp) + self._delay
        self._selector.add_keyword(message.gesture, stroke, message.phrase)

    def _on_cut(self, cut: Cut) -> None:
        moment = seconds(cut.header.stamp)
        self._cuts.add(cut.header.frame_id, cut.utterance, moment)
        self._selector.cut(moment + self._delay)
        self._plan()

    def _on_emotion(self, message: Emotion) -> None:
        with self._taken("emotion"):
            self._selector.set_emotion(message.expression, message.valence, message.arousal)

    def _on_control(self, message: Control) -> None:
        since = seconds(message.header.stamp) or self.now()
        with self._taken("control"):
            self._selector.set_controls([constraint_from(wanted) for wanted in message.constraints], since)

    def _reload(self) -> None:
        try:
            if self._banks.changed():
                self._refused.pop("banks", None)
                self._selector.set_gestures(self._banks.gestures)
        except GestureBotError as error:
            self._refused["banks"] = str(error)
            raise

    @contextmanager
    def _taken(self, what: str) -> Iterator[None]:
        """Tell of a message that is taken, or why the last one was refused and the one before stays."""
        self._refused.pop(what, None)
        try:
            yield
        except GestureBotError as error:
            self._refused[what] = str(error)
            raise
        finally:
            self._report()
        self._publish_state()

    def _plan(self) -> None:
        for window in self._selector.plan(self.now()):
            self._windows.publish(_message(window))
        self._publish_state()

    def _publish_state(self) -> None:
        """Publish what steers the selection, where it has changed."""
        selector = self._selector
        said = selector.emotion, selector.constraints, selector.relaxed, selector.eligible, selector.late
        if said == self._said:
            return
        self._said = said
        if selector.relaxed:
            self.get_logger().warning(f"too few windows fit all; gave way: {', '.join(selector.relaxed)}")
        state = SelectorState(
            expression=selector.emotion,
            constraints=[constraint_to(constraint) for constraint in selector.constraints],
            relaxed=selector.relaxed,
            eligible=selector.eligible,
            delay=self._delay,
            late=selector.late,
        )
        state.header.stamp = stamp(self.now())
        self._states.publish(state)

    def _report(self) -> None:
        said = [f"refused {what}: {why}" for what, why in self._refused.items()]
        if relaxed := self._selector.relaxed:
            said.append(f"gave way: {', '.join(relaxed)}")
        status = DiagnosticStatus(
            name="gesture_bot: gesture selector",
            level=DiagnosticStatus.WARN if said else DiagnosticStatus.OK,
            message="; ".join(said) or "all constraints hold",
            values=key_values(
                expression=self._selector.emotion,
                constraints=len(self._selector.constraints),
                eligible_windows=f"{self._selector.eligible:.3f}",
                late=self._selector.late,
            ),
        )
        message = DiagnosticArray(status=[status])
        message.header.stamp = stamp(self.now())
        self._diagnostics.publish(message)


def _message(window: Window) -> GestureWindow:
    message = clip_to(KeypointClip(window.start, window.keypoints), window.source)
    message.name = window.name
    message.sequence, message.frame = window.sequence, window.frame
    message.pose_distance, message.audio_distance = window.pose_distance, window.audio_distance
    message.candidates = window.candidates
    return message
