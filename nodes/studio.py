"""The page in the browser: what the graph tells goes in, what people do there goes out on public topics."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.callback_groups import CallbackGroup
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription
from std_msgs.msg import Bool, String
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

from gesture_bot.base.errors import GestureBotError, InvalidValueError
from gesture_bot.base.frames import frame_time
from gesture_bot.corpus.demo import load_database
from gesture_bot.matching.banks import WatchedBanks
from gesture_bot.matching.controls import Controls, Demand
from gesture_bot.matching.emotions import load_emotions
from gesture_bot.msg import (
    Audio,
    Control,
    Cut,
    Emotion,
    GestureWindow,
    Keyword,
    SelectorState,
    SpeechFeatures,
    Word,
)
from gesture_bot.nodes.constraints import constraint_from, constraint_to
from gesture_bot.nodes.messages import clip_from, trajectory_from
from gesture_bot.nodes.node import PLAN, STATE, STREAM, Polled, diagnostic, poll, seconds, stamp
from gesture_bot.nodes.teleop import Operator
from gesture_bot.retarget.robot import load_robot
from gesture_bot.servo.trajectories import Overlay
from gesture_bot.speech.liveness import Liveness
from gesture_bot.studio.guard import open_server
from gesture_bot.studio.page import RATE, Page
from gesture_bot.studio.tables import Servo

STROKE = 1.2
"""A gesture that is asked for has its stroke so much later [s]: what is sooner is planned already."""

JOIN = 0.1
"""Half-life with which the target passes from one trajectory to the next [s]."""


class Studio(Operator):
    """Shows the graph on a page, and passes on what people do there."""

    def __init__(self, name: str = "studio", **options: Any):
        super().__init__(name, **options)
        self._robot = load_robot(
            self.parameter("robot", "toa", "Robot: a name in config/robots, or a YAML file")
        )
        database = self.parameter(
            "database",
            "demo",
            "Gesture database: a file, or 'demo' (built on first use)",
        )
        banks = self.parameter("banks", "shipped", "Semantic banks: a folder of YAML files, or 'shipped'")
        address = self.parameter("studio_address", "127.0.0.1:8080", "Where the page is: HOST:PORT")
        self._banks = WatchedBanks(banks)
        self._liveness = Liveness()
        self._target = Overlay(self._robot.joints, JOIN)
        self._say = self.create_publisher(String, "say", PLAN)
        self._emotion = self.create_publisher(Emotion, "emotion", STATE)
        self._control = self.create_publisher(Control, "control", STATE)
        self._keywords = self.create_publisher(Keyword, "speech/keywords", PLAN)
        self._reset = self.create_client(Trigger, "reset")
        emotions, controls = load_emotions(), Controls(load_database(database))
        self._server, url = open_server(address)
        self._page = Page(self._server, self._robot, emotions, controls, self)
        self._page.gestures.show(self._banks.gestures)
        if self._page.bare:
            link, why = next(iter(self._page.bare.items()))
            others = len(self._page.bare) - 1
            self.get_logger().info(f"simple shapes stand for {link} and {others} other links: {why}")
        # All that comes would wake it two hundred times a second, and nobody looks so fast.
        polled = Polled()
        self.follow(self._robot, polled)
        self._heard = [self.joint_states, *self._listen(polled)]
        self.every(1 / RATE, self._show)
        self.every(1.0, self._report)
        self.every(1.0, self._reload)
        if "token" in url:
            self.get_logger().warning(
                "other computers can open the studio with the token, and move the robot; nothing is encrypted"
            )
        self.waits_for(f"a browser: open {url}")

    def destroy_node(self) -> None:
        """Close the page, too."""
        self._server.stop()
        super().destroy_node()

    def say(self, text: str) -> None:
        """Speak a text; this and what follows is Steering, which the page calls."""
        self._say.publish(String(data=text))

    def feel(self, expression: str, valence: float = 0.0, arousal: float = 0.0) -> None:
        """Feel an emotion."""
        message = Emotion(expression=expression, valence=valence, arousal=arousal)
        message.header.stamp = stamp(self.now())
        self._emotion.publish(message)

    def constrain(self, constraints: Sequence[Demand]) -> None:
        """Put constraints on the motion."""
        message = Control(constraints=[constraint_to(constraint) for constraint in constraints])
        message.header.stamp = stamp(self.now())
        self._control.publish(message)

    def make(self, gesture: str) -> None:
        """Make a gesture of the semantic bank."""
        if gesture not in self._banks.gestures:
            raise InvalidValueError("the bank has this gesture no more", gesture, self._banks.gestures)
        moment, trigger = stamp(self.now() + STROKE), self._banks.gestures[gesture].triggers[0]
        message = Keyword(gesture=gesture, phrase=trigger.phrase, begin=moment, confidence=1.0)
        message.header.stamp, message.header.frame_id = moment, self.get_name()
        self._keywords.publish(message)

    def go(self, angles: Mapping[str, float]) -> None:
        """Take joints, and send them to angles."""
        self.take(angles)
        self.jog.go(angles)

    def take(self, joints: Iterable[str]) -> None:
        """Take joints where they are."""
        if self.stopped:
            raise GestureBotError("the robot is stopped: `Reset` lets it move again")
        super().take(joints)

    def give_back(self, joints: Iterable[str]) -> None:
        """Leave joints to others."""
        self.jog.give_back(joints)

    def stop(self) -> None:
        """Stop the robot, from any thread; what is taken is given back once the stop is heard to hold."""
        self._stop.publish(Bool(data=True))

    def reset(self) -> None:
        """Ask for the end of a stop."""
        if not self._reset.service_is_ready():
            raise GestureBotError("nobody offers the service `reset`")
        self._reset.call_async(Trigger.Request())

    def _tick(self) -> None:
        poll(self.joint_states)
        super()._tick()

    def _show(self) -> None:
        for subscription in self._heard:
            poll(subscription)
        self._page.deal()
        if not self._page.browsers:
            self.give_all_back()  # nobody is left who could
        if not self.jog.taken:
            self.ticking.cancel()
        elif self.ticking.is_canceled():
            self.ticking.reset()
        now = self.now()
        self._page.facts.owners = self.owners
        self._page.show(now, self.measured, self.jog.goals, lambda: self._target.at(np.array([now]))[0][0])

    def _reload(self) -> None:
        if self._banks.changed():
            self._page.gestures.show(self._banks.gestures)

    def _report(self) -> None:
        taken = ", ".join(self.jog.taken) or "nothing"
        self.diagnose(diagnostic("studio", self.errors(), "running", pages=self._page.browsers, taken=taken))

    def _listen(self, group: CallbackGroup) -> list[Subscription]:
        strip = self._page.strip

        def on_audio(message: Audio) -> None:
            source, start = message.header.frame_id, seconds(message.header.stamp)
            self._page.facts.live = self._liveness.is_live(source, message.utterance, start, self.now())
            strip.add_sound(
                source, message.utterance, start, np.asarray(message.samples), message.sample_rate
            )

        def on_word(message: Word) -> None:
            start = seconds(message.header.stamp)
            strip.add_word(message.header.frame_id, message.utterance, start, message.duration, message.text)

        def on_keyword(message: Keyword) -> None:
            strip.add_keyword(seconds(message.begin), message.duration)

        def on_features(message: SpeechFeatures) -> None:
            for beat in message.beats:
                strip.add_beat(seconds(message.header.stamp) + beat)

        def on_cut(message: Cut) -> None:
            strip.cut(message.header.frame_id, message.utterance, seconds(message.header.stamp))

        def on_chosen(message: GestureWindow) -> None:
            clip = clip_from(message)
            self._page.chosen.frames.add(clip)
            strip.add_window(frame_time(clip.start), frame_time(clip.stop), message.source, message.name)

        def on_refined(message: GestureWindow) -> None:
            self._page.refined.frames.add(clip_from(message))

        def on_target(message: JointTrajectory) -> None:
            now = self.now()
            self._target.add(trajectory_from(message, now), now)

        def on_state(message: SelectorState) -> None:
            self._page.expression = message.expression
            self._page.facts.look_ahead = message.look_ahead
            self._page.demands = [constraint_from(constraint) for constraint in message.constraints]
            control = ", ".join(map(str, self._page.demands))
            strip.set_state(self.now(), message.expression, control)

        topics: tuple[tuple[type, str, Callable[[Any], None], QoSProfile], ...] = (
            (Audio, "speech/audio", on_audio, STREAM),
            (Word, "speech/words", on_word, PLAN),
            (Keyword, "speech/keywords", on_keyword, PLAN),
            (SpeechFeatures, "speech/features", on_features, STREAM),
            (Cut, "speech/cut", on_cut, PLAN),
            (GestureWindow, "gesture/selected", on_chosen, PLAN),
            (GestureWindow, "gesture/refined", on_refined, PLAN),
            (JointTrajectory, "gesture/joint_trajectory", on_target, PLAN),
            (SelectorState, "gesture/selector_state", on_state, STATE),
            (DiagnosticArray, "/diagnostics", self._on_diagnostics, PLAN),
        )
        return [self.listen(*topic, group) for topic in topics]

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        facts = self._page.facts
        for status in message.status:
            part = status.name.removeprefix("gesture_bot: ")
            values = {pair.key: pair.value for pair in status.values}
            trouble = status.message if status.level != DiagnosticStatus.OK else ""
            joint = part.removeprefix("servo ")
            if joint in self._robot.joints:
                load = _number(values.get("load_percent")) / 100
                facts.servos[joint] = Servo(_number(values.get("temperature_degc")), load, trouble)
                continue
            if part == "servo bus":
                facts.lag = _number(values.get("lag_ms")) / 1000
            facts.troubles.pop(part, None)
            if trouble:
                facts.troubles[part] = trouble


def _number(text: str | None) -> float:
    """The number in a value of a diagnostic; NaN where there is none."""
    try:
        return float(text or "nan")
    except ValueError:
        return math.nan
