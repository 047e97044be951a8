"""Words in, keywords of the semantic banks out."""

from collections.abc import Iterable
from typing import Any

from std_msgs.msg import Header

from gesture_bot.matching.banks import load_banks, triggers
from gesture_bot.msg import Keyword
from gesture_bot.msg import Word as WordMessage
from gesture_bot.nodes.node import PLAN, GestureNode, seconds, stamp
from gesture_bot.speech import keywords
from gesture_bot.speech.voice import Word

PATIENCE = 0.2
"""A phrase that could go on is taken as it is when no further word comes for so long [s]."""


class KeywordSpotter(GestureNode):
    """Finds the trigger words and phrases of the semantic banks among the words that are heard."""

    def __init__(self, name: str = "keyword_spotter", **options: Any):
        super().__init__(name, **options)
        banks = self.parameter("banks", "shipped", "Semantic banks: a folder of YAML files, or 'shipped'")
        self._spotter = keywords.KeywordSpotter(triggers(load_banks(banks)))
        self._heard, self._confidence = 0.0, 1.0
        self._publisher = self.create_publisher(Keyword, "speech/keywords", PLAN)
        self.listen(WordMessage, "speech/words", self._on_word, PLAN)
        self.listen(Header, "speech/cut", lambda message: self._spotter.forget(), PLAN)
        self.every(PATIENCE / 2, self._flush)
        self.waits_for("words on speech/words")

    def _on_word(self, message: WordMessage) -> None:
        begin = seconds(message.header.stamp)
        word = Word(message.text, begin, begin + message.duration, begin + message.stress)
        self._heard = self.now()
        self._confidence = message.confidence
        self._publish(self._spotter.spot([word]))

    def _flush(self) -> None:
        """Words that may become a longer phrase have waited long enough."""
        if self.now() - self._heard > PATIENCE:
            self._publish(self._spotter.flush())

    def _publish(self, found: Iterable[keywords.Spotted]) -> None:
        for spotted in found:
            keyword = Keyword(
                gesture=spotted.gesture,
                phrase=spotted.phrase,
                begin=stamp(spotted.start),
                duration=spotted.end - spotted.start,
                confidence=self._confidence,
            )
            keyword.header.stamp = stamp(spotted.stress)
            self._publisher.publish(keyword)
