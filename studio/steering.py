"""What the page asks for: each of it is a message or a call that any program may send."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Protocol

from gesture_bot.matching.controls import Demand


class Steering(Protocol):
    """Whoever passes on what people do on the page. All but `stop` is called by `Page.tick` alone."""

    def say(self, text: str) -> None:
        """Speak a text."""

    def feel(self, expression: str, valence: float = 0.0, arousal: float = 0.0) -> None:
        """Feel an emotion: a name of hri_msgs/Expression, or, where that is empty, the nearest one."""

    def constrain(self, constraints: Sequence[Demand]) -> None:
        """Put constraints on the motion, in place of those before."""

    def make(self, gesture: str) -> None:
        """Make a gesture of the semantic bank, as if its word were spoken."""

    def go(self, angles: Mapping[str, float]) -> None:
        """Take joints, and send them to angles [rad]."""

    def take(self, joints: Iterable[str]) -> None:
        """Take joints where they are."""

    def give_back(self, joints: Iterable[str]) -> None:
        """Leave joints to others."""

    def stop(self) -> None:
        """Stop the robot, until `reset`. May be called from any thread, and acts at once."""

    def reset(self) -> None:
        """End a stop."""
