"""How the robot feels, as every node hears it that listens."""

from collections.abc import Callable

from gesture_bot.msg import Emotion
from gesture_bot.nodes.node import GestureNode

try:
    from hri_msgs.msg import Expression
except ImportError:  # the package is not installed
    Expression = None


def listen_to_emotion(node: GestureNode, callback: Callable[[Emotion], None]) -> None:
    """Call back with the emotion in force, now and at every change; an Expression has the same fields."""
    node.listen_to_state(Emotion, "emotion", callback)
    if Expression:
        # Where the robots of PAL take the expression of their face, in the terms of REP-155.
        node.listen_to_state(Expression, "robot_face/expression", callback)
