"""Listens to the whole graph and keeps what passed, with the moment at which it arrived."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from gesture_bot.msg import Audio, GestureWindow, JointOwners, Keyword, SelectorState, SpeechFeatures, Word
from gesture_bot.nodes.node import PLAN, STATE, STREAM, GestureNode, seconds


@dataclass(frozen=True)
class Heard:
    """A message, the moment it arrived and the moment it speaks of [s since the epoch]."""

    arrival: float
    stamp: float
    message: Any


@dataclass
class Record:
    """Everything that was heard, in the order of arrival, one list a topic."""

    audio: list[Heard] = field(default_factory=list)
    words: list[Heard] = field(default_factory=list)
    keywords: list[Heard] = field(default_factory=list)
    features: list[Heard] = field(default_factory=list)
    selected: list[Heard] = field(default_factory=list)
    states: list[Heard] = field(default_factory=list)
    refined: list[Heard] = field(default_factory=list)
    trajectories: list[Heard] = field(default_factory=list)
    owners: list[Heard] = field(default_factory=list)
    joint_states: list[Heard] = field(default_factory=list)
    diagnostics: list[Heard] = field(default_factory=list)

    def joint_positions(self) -> tuple[np.ndarray, np.ndarray]:
        """(n,) moments [s since the epoch] and (n, j) measured joint positions [rad]."""
        times = np.array([heard.stamp for heard in self.joint_states])
        return times, np.array([heard.message.position for heard in self.joint_states])


class Recorder(GestureNode):
    """Fills a Record while it spins."""

    def __init__(self, name: str = "recorder", **options: Any):
        super().__init__(name, **options)
        self.record = Record()
        for message_type, topic, kept, qos in (
            (Audio, "speech/audio", self.record.audio, STREAM),
            (Word, "speech/words", self.record.words, PLAN),
            (Keyword, "speech/keywords", self.record.keywords, PLAN),
            (SpeechFeatures, "speech/features", self.record.features, STREAM),
            (GestureWindow, "gesture/selected", self.record.selected, PLAN),
            (SelectorState, "gesture/selector_state", self.record.states, STATE),
            (GestureWindow, "gesture/refined", self.record.refined, PLAN),
            (JointTrajectory, "gesture/joint_trajectory", self.record.trajectories, PLAN),
            (JointOwners, "motion_mux/owners", self.record.owners, STATE),
            (JointState, "joint_states", self.record.joint_states, STREAM),
            (DiagnosticArray, "/diagnostics", self.record.diagnostics, PLAN),
        ):
            self._keep(message_type, topic, kept, qos)

    def _keep(self, message_type: type, topic: str, kept: list[Heard], qos: Any) -> None:
        def on_message(message: Any, info: Any) -> None:
            arrival = info["received_timestamp"] * 1e-9  # however long it waited for this process
            stamped = hasattr(message, "header")
            kept.append(Heard(arrival, seconds(message.header.stamp) if stamped else arrival, message))

        self.create_subscription(message_type, topic, on_message, qos)  # type: ignore[arg-type]
