"""When the motion for what is heard is seen; for all nodes that make motion for speech."""

import numpy as np

from gesture_bot.base.frames import first_frame_after
from gesture_bot.matching.hearing import Hearing
from gesture_bot.msg import Cut, Keyword, SpeechFeatures
from gesture_bot.nodes.node import seconds
from gesture_bot.speech.cuts import Cuts
from gesture_bot.speech.liveness import Liveness

LOOK_AHEAD = 0.8
"""How much later than sound that is heard live its motion is seen, until the selector says otherwise [s]."""


class Placing:
    """Places messages about speech in time.

    Attributes:
        look_ahead: How much later than sound that is heard live its motion is seen [s].
    """

    def __init__(self, look_ahead: float = LOOK_AHEAD) -> None:
        self.look_ahead = look_ahead
        self._cuts, self._liveness = Cuts(), Liveness()

    def place(self, message: SpeechFeatures | Keyword, now: float) -> tuple[float, bool] | None:
        """When the motion is seen [s since the epoch], and whether it is live; None where it was cut."""
        source, moment = message.header.frame_id, seconds(message.header.stamp)
        if self._cuts.void(source, message.utterance, moment):
            return None
        live = self._liveness.is_live(source, message.utterance, moment, now)
        return moment + live * self.look_ahead, live

    def cut(self, cut: Cut) -> float:
        """Take in a cut; its moment [s since the epoch]."""
        moment = seconds(cut.header.stamp)
        self._cuts.add(cut.header.frame_id, cut.utterance, moment)
        return moment


def hear(hearing: Hearing, message: SpeechFeatures, seen: float, live: bool) -> None:
    """Take in the features of a frame whose motion is seen at a moment [s since the epoch]."""
    features = np.asarray(message.features)
    hearing.add_features(first_frame_after(seen), features, message.speech, message.header.frame_id, live)
