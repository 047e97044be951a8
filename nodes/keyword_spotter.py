"""Words in, keywords of the semantic banks out."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from gesture_bot.matching.banks import WatchedBanks, triggers
from gesture_bot.msg import Cut, Keyword
from gesture_bot.msg import Word as WordMessage
from gesture_bot.nodes import hri_speech
from gesture_bot.nodes.node import PLAN, GestureNode, diagnostic, seconds, stamp
from gesture_bot.speech import keywords
from gesture_bot.speech.cuts import Cuts
from gesture_bot.speech.voice import Word

PATIENCE = 0.2
"""A phrase that could go on is taken as it is when no further word comes for so long [s]."""

RECOGNISED_PATIENCE = 0.8
"""The same for words that are recognised, which come some time after they have been said [s]."""


@dataclass
class _Source:
    """A source of words, the last of them, and when it came [s since the epoch]."""

    spotter: keywords.KeywordSpotter
    last: WordMessage
    heard: float


class KeywordSpotter(GestureNode):
    """Finds the trigger words and phrases of the semantic banks among the words that are heard."""

    def __init__(self, name: str = "keyword_spotter", **options: Any):
        super().__init__(name, **options)
        banks = self.parameter("banks", "shipped", "Semantic banks: a folder of YAML files, or 'shipped'")
        self._banks = WatchedBanks(banks)
        self._triggers = triggers(self._banks.gestures)
        keywords.KeywordSpotter(self._triggers)  # a bad trigger is told at the start
        self._sources: dict[str, _Source] = {}
        self._cuts = Cuts()
        self._found = 0
        self._publisher = self.create_publisher(Keyword, "speech/keywords", PLAN)
        self.listen(WordMessage, "speech/words", self._on_word, PLAN)
        self.listen(Cut, "speech/cut", self._on_cut, PLAN)
        hri_speech.listen(self, self._on_transcript)
        self.every(PATIENCE / 2, self._flush)
        self.every(1.0, self._reload)
        self.every(1.0, self._report)
        self.waits_for("words on speech/words")

    def _on_cut(self, cut: Cut) -> None:
        moment = seconds(cut.header.stamp)
        self._cuts.add(cut.header.frame_id, cut.utterance, moment)
        if source := self._sources.get(cut.header.frame_id):
            source.spotter.cut(moment)

    def _on_word(self, message: WordMessage) -> None:
        name, begin = message.header.frame_id, seconds(message.header.stamp)
        if self._cuts.void(name, message.utterance, begin):
            return
        if name not in self._sources:
            self._sources[name] = _Source(keywords.KeywordSpotter(self._triggers), message, 0.0)
        source = self._sources[name]
        if source.last.utterance != message.utterance:
            self._publish(source, source.spotter.flush())
        source.last, source.heard = message, self.now()
        word = Word(message.text, begin, begin + message.duration, begin + message.stress)
        self._publish(source, source.spotter.spot([word]))

    def _on_transcript(self, words: list[str], confidence: float) -> None:
        """Words of a recogniser that tells no times: they have just been said."""
        for text in words:
            message = WordMessage(text=text, confidence=confidence)
            message.header.stamp, message.header.frame_id = stamp(self.now()), "transcript"
            self._on_word(message)

    def _reload(self) -> None:
        if self._banks.changed():
            self._triggers = triggers(self._banks.gestures)
            for source in self._sources.values():
                source.spotter.set_triggers(self._triggers)

    def _flush(self) -> None:
        """Words that may become a longer phrase have waited long enough."""
        for source in self._sources.values():
            known = source.last.confidence == 1.0
            if self.now() - source.heard > (PATIENCE if known else RECOGNISED_PATIENCE):
                self._publish(source, source.spotter.flush())

    def _publish(self, source: _Source, found: Iterable[keywords.Spotted]) -> None:
        for spotted in found:
            keyword = Keyword(
                gesture=spotted.gesture,
                phrase=spotted.phrase,
                begin=stamp(spotted.start),
                duration=spotted.end - spotted.start,
                confidence=source.last.confidence,
                utterance=source.last.utterance,
            )
            keyword.header.stamp = stamp(spotted.stress)
            keyword.header.frame_id = source.last.header.frame_id
            self._publisher.publish(keyword)
            self._found += 1

    def _report(self) -> None:
        known, found = len(self._triggers), self._found
        self.diagnose(diagnostic("keyword spotter", self.errors(), "running", triggers=known, keywords=found))
