"""Speech features, keywords, emotion and control in; gesture windows of the database out."""

from pathlib import Path
from typing import Any, get_args

import numpy as np

from gesture_bot.base.frames import FRAME_RATE, KeypointClip
from gesture_bot.corpus.database import Database
from gesture_bot.corpus.demo import demo_database
from gesture_bot.matching.banks import load_banks
from gesture_bot.matching.controls import Constraint
from gesture_bot.matching.emotions import load_emotions
from gesture_bot.matching.search import Preselection
from gesture_bot.matching.selector import Selector, Window
from gesture_bot.msg import Constraint as ConstraintMessage
from gesture_bot.msg import Control, Emotion, GestureWindow, Keyword, SelectorState, SpeechFeatures
from gesture_bot.nodes.messages import clip_to
from gesture_bot.nodes.node import PLAN, STATE, STREAM, GestureNode, seconds, stamp


class GestureSelector(GestureNode):
    """Runs the motion matching search of MM22 against the clock, one window ahead of what is seen."""

    def __init__(self, name: str = "gesture_selector", **options: Any):
        super().__init__(name, **options)
        database = self.parameter(
            "database", "demo", "Gesture database: a file, or 'demo' (built on first use)"
        )
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
        self._selector = Selector(
            Database.load(demo_database() if database == "demo" else Path(database)),
            emotions=load_emotions(),
            gestures=load_banks(),
            k=k,
            preselection=preselection,
            seed=seed,
        )
        self._selector.set_emotion(emotion)
        self._windows = self.create_publisher(GestureWindow, "gesture/selected", PLAN)
        self._states = self.create_publisher(SelectorState, "gesture/selector_state", STATE)
        self._constraints: list[ConstraintMessage] = []
        self._relaxed: list[str] = []
        self._publish_state()

        self.listen(SpeechFeatures, "speech/features", self._on_features, STREAM)
        self.listen(Keyword, "speech/keywords", self._on_keyword, PLAN)
        self.listen_to_state(Emotion, "emotion", self._on_emotion)
        self.listen_to_state(Control, "control", self._on_control)
        self.every(1 / FRAME_RATE, self._plan)
        self.waits_for("features on speech/features; rests until then")

    def _on_features(self, message: SpeechFeatures) -> None:
        frame = round((seconds(message.header.stamp) + self._delay) * FRAME_RATE)
        self._selector.add_features(frame, np.asarray(message.features))

    def _on_keyword(self, message: Keyword) -> None:
        self._selector.add_keyword(message.gesture, seconds(message.header.stamp) + self._delay)

    def _on_emotion(self, message: Emotion) -> None:
        self._selector.set_emotion(message.expression, message.valence, message.arousal)
        self._publish_state()

    def _on_control(self, message: Control) -> None:
        self._selector.set_controls(
            [
                Constraint(wanted.quantity, wanted.hand, wanted.bound, wanted.value, wanted.unit)
                for wanted in message.constraints
            ]
        )
        self._constraints = message.constraints
        self._publish_state()

    def _plan(self) -> None:
        for window in self._selector.plan(self.now()):
            self._windows.publish(_message(window))
        if self._selector.late != self._late:
            self._publish_state()

    def _publish_state(self) -> None:
        state = SelectorState(
            expression=self._selector.emotion,
            constraints=self._constraints,
            relaxed=self._selector.relaxed,
            eligible=self._selector.eligible,
            delay=self._delay,
            late=self._selector.late,
        )
        if state.relaxed and state.relaxed != self._relaxed:
            self.get_logger().warning(f"too few windows fit all; gave way: {', '.join(state.relaxed)}")
        self._late, self._relaxed = state.late, state.relaxed
        state.header.stamp = stamp(self.now())
        self._states.publish(state)


def _message(window: Window) -> GestureWindow:
    message = clip_to(KeypointClip(window.start, window.keypoints), window.source)
    message.name = window.name
    message.sequence, message.frame = window.sequence, window.frame
    message.pose_distance, message.audio_distance = window.pose_distance, window.audio_distance
    message.candidates = window.candidates
    return message
