"""Words in, keywords of the semantic banks out."""

from typing import Any

from gesture_bot.matching.banks import load_banks, triggers
from gesture_bot.msg import Keyword
from gesture_bot.msg import Word as WordMessage
from gesture_bot.nodes.node import PLAN, GestureNode, seconds, stamp
from gesture_bot.speech import keywords
from gesture_bot.speech.voice import Word


class KeywordSpotter(GestureNode):
    """Finds the trigger words and phrases of the semantic banks among the words that are heard."""

    def __init__(self, name: str = "keyword_spotter", **options: Any):
        super().__init__(name, **options)
        self._spotter = keywords.KeywordSpotter(triggers(load_banks()))
        self._publisher = self.create_publisher(Keyword, "speech/keywords", PLAN)
        self.listen(WordMessage, "speech/words", self._on_word, PLAN)
        self.waits_for("words on speech/words")

    def _on_word(self, message: WordMessage) -> None:
        begin = seconds(message.header.stamp)
        word = Word(message.text, begin, begin + message.duration, begin + message.stress)
        for spotted in self._spotter.spot([word]):
            keyword = Keyword(
                gesture=spotted.gesture,
                phrase=spotted.phrase,
                begin=stamp(spotted.start),
                duration=spotted.end - spotted.start,
                confidence=message.confidence,
            )
            keyword.header.stamp = stamp(spotted.stress)
            self._publisher.publish(keyword)
