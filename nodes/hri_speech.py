"""Words from hri_msgs/LiveSpeech (REP-155), the form in which ROS4HRI's speech recognisers write."""

from collections.abc import Callable
from typing import Any

from rclpy.exceptions import InvalidTopicNameException

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.nodes.node import PLAN, GestureNode
from gesture_bot.speech.transcripts import Transcript

try:
    from hri_msgs.msg import IdsList, LiveSpeech
except ImportError:  # the package is not installed, or is an older one
    LiveSpeech = None

VOICES = "/humans/voices"


def listen(node: GestureNode, on_words: Callable[[list[str], float], None]) -> None:
    """Hear what every tracked voice says, where hri_msgs is installed.

    Args:
        node: Who hears.
        on_words: Takes the new words and how sure the recogniser is of them, 0 to 1.
    """
    if LiveSpeech is None:
        return
    heard: dict[str, Any] = {}

    def on_tracked(voices: Any) -> None:
        for gone in heard.keys() - set(voices.ids):
            node.destroy_subscription(heard.pop(gone))
        for voice in set(voices.ids) - heard.keys():
            try:
                heard[voice] = node.listen(LiveSpeech, f"{VOICES}/{voice}/speech", _follow(on_words), PLAN)
            except InvalidTopicNameException as error:
                raise InvalidValueError("the id of a voice is no part of a topic's name", voice) from error

    node.listen(IdsList, f"{VOICES}/tracked", on_tracked, PLAN)


def _follow(on_words: Callable[[list[str], float], None]) -> Callable[[Any], None]:
    transcript = Transcript()

    def on_speech(speech: Any) -> None:
        if speech.final:
            on_words(transcript.final(speech.final), speech.confidence)
        else:
            on_words(transcript.incremental(speech.incremental), speech.confidence)

    return on_speech
