"""Speech features, keywords, emotion and control in; gesture windows of the database out."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, get_args

from gesture_bot.base.errors import GestureBotError
from gesture_bot.base.frames import FRAME_RATE, KeypointClip
from gesture_bot.corpus.demo import load_database
from gesture_bot.matching.banks import WatchedBanks
from gesture_bot.matching.emotions import load_emotions
from gesture_bot.matching.search import Preselection
from gesture_bot.matching.selector import Selector, Window
from gesture_bot.msg import Control, Cut, Emotion, GestureWindow, Keyword, SelectorState, SpeechFeatures
from gesture_bot.nodes.constraints import constraint_from, constraint_to
from gesture_bot.nodes.emotions import listen_to_emotion
from gesture_bot.nodes.messages import clip_to
from gesture_bot.nodes.node import PLAN, STATE, STREAM, GestureNode, diagnostic, seconds, stamp
from gesture_bot.nodes.placing import LOOK_AHEAD, Placing, hear


class GestureSelector(GestureNode):
    """Runs the motion matching search of MM22 against the clock, one window ahead of what is seen."""

    def __init__(self, name: str = "gesture_selector", **options: Any):
        super().__init__(name, **options)
        database = self.parameter(
            "database",
            "demo",
            "Gesture database: a file, or 'demo' (built on first use)",
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
        align_beats = self.parameter(
            "align_beats",
            False,
            "Play the windows so that the hands' beats fall on those of the speech (RG22)",
        )
        look_ahead = self.parameter(
            "look_ahead",
            LOOK_AHEAD,
            "How much later than sound that is heard live, as by a microphone, its motion is seen [s]",
            bounds=(0.25, 1.1),
        )
        self._banks = WatchedBanks(banks)
        self._selector = Selector(
            load_database(database),
            emotions=load_emotions(),
            gestures=self._banks.gestures,
            k=k,
            preselection=preselection,
            seed=seed,
            align_beats=align_beats,
        )
        self._selector.set_emotion(emotion)
        self._windows = self.create_publisher(GestureWindow, "gesture/selected", PLAN)
        self._states = self.create_publisher(SelectorState, "gesture/selector_state", STATE)
        self._placing = Placing(look_ahead)
        self._too_late = 0
        self._said: tuple[Any, ...] = ()
        self._refused: dict[str, str] = {}
        self._publish_state()

        self.listen(SpeechFeatures, "speech/features", self._on_features, STREAM)
        self.listen(Keyword, "speech/keywords", self._on_keyword, PLAN)
        self.listen(Cut, "speech/cut", self._on_cut, PLAN)
        listen_to_emotion(self, self._on_emotion)
        self.listen_to_state(Control, "control", self._on_control)
        self.every(1 / FRAME_RATE, self._plan)
        self.every(1.0, self._report)
        self.every(1.0, self._reload)
        self.waits_for("features on speech/features; rests until then")

    def _on_features(self, message: SpeechFeatures) -> None:
        placed = self._placing.place(message, self.now())
        if placed is None:
            return
        seen, live = placed
        if seen < self.now():
            self._too_late += 1
            return
        hear(self._selector.hearing, message, seen, live)
        for beat in message.beats:
            self._selector.hearing.add_beat(seen + beat)

    def _on_keyword(self, message: Keyword) -> None:
        if placed := self._placing.place(message, self.now()):
            self._selector.add_keyword(message.gesture, placed[0], message.phrase)

    def _on_cut(self, cut: Cut) -> None:
        self._selector.cut(self._placing.cut(cut))
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
            look_ahead=self._placing.look_ahead,
            late=selector.late,
        )
        state.header.stamp = stamp(self.now())
        self._states.publish(state)

    def _report(self) -> None:
        selector = self._selector
        troubles = [f"refused {what}: {why}" for what, why in self._refused.items()]
        if selector.relaxed:
            troubles.append(f"gave way: {', '.join(selector.relaxed)}")
        self.diagnose(
            diagnostic(
                "gesture selector",
                troubles,
                "all constraints hold",
                expression=selector.emotion,
                constraints=len(selector.constraints),
                eligible_windows=f"{selector.eligible:.3f}",
                late=selector.late,
                features_too_late=self._too_late,
            )
        )


def _message(window: Window) -> GestureWindow:
    message = clip_to(KeypointClip(window.start, window.keypoints), window.source)
    message.name = window.name
    message.sequence, message.frame = window.sequence, window.frame
    message.pose_distance, message.audio_distance = window.pose_distance, window.audio_distance
    message.candidates = window.candidates
    message.kept = [constraint_to(constraint) for constraint in window.kept]
    return message
