"""The sound that the robot gestures to: text spoken by a voice, or a sound file."""

import queue
import threading
from collections import deque
from typing import Any

import numpy as np
from std_msgs.msg import String

from gesture_bot.base.errors import GestureBotError
from gesture_bot.base.frames import first_frame_after, frame_time
from gesture_bot.msg import Audio
from gesture_bot.msg import Word as WordMessage
from gesture_bot.nodes.node import PLAN, STREAM, GestureNode, seconds, stamp
from gesture_bot.speech.audio import SAMPLE_RATE, load_audio
from gesture_bot.speech.voice import Utterance, Voice, load_voice

PIECE = SAMPLE_RATE // 10
"""Samples in one message: 100 ms."""

GRAPH = ("speech/audio", "speech/features", "gesture/selected", "gesture/refined", "gesture/joint_trajectory")
"""Topics that need a listener before something that is played once may begin."""


LAST_RETRACTION = 1.5
"""From the end of what is played once to the end of the graph, time for the arms to come down [s]."""


class SpeechSource(GestureNode):
    """Publishes sound ahead of the moment at which it is heard, so that gestures have time to prepare."""

    def __init__(self, name: str = "speech_source", **options: Any):
        super().__init__(name, **options)
        speech = self.parameter(
            "speech", "say", "'say' (text on the topic `say`), or a sound file to play once"
        )
        text = self.parameter("text", "", "Text to speak once; the graph ends when it has been spoken")
        voice = self.parameter("voice", "embedded", "Voice that speaks text")
        self._lead = self.parameter(
            "lead", 2.0, "How long before it is heard sound is published at most [s]", bounds=(0.0, 10.0)
        )
        self._start_delay = self.parameter(
            "start_delay",
            0.8,
            "From the synthesis of a text to its sound, time for a first gesture [s]",
            bounds=(0.0, 10.0),
        )
        self._audio = self.create_publisher(Audio, "speech/audio", STREAM)
        self._words = self.create_publisher(WordMessage, "speech/words", PLAN)
        self._texts: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self._synthesis: threading.Thread | None = None
        self._utterances: queue.SimpleQueue[Utterance] = queue.SimpleQueue()
        self._pieces: deque[Audio] = deque()
        self._utterance = 0
        self._free_at = 0.0

        self._once = bool(text) or speech != "say"
        if text:
            self._utterances.put(load_voice(voice).speak(text))
        elif speech != "say":
            self._utterances.put(Utterance(load_audio(speech), ()))
        else:
            self.listen(String, "say", lambda message: self._texts.put(message.data), PLAN)
            # Synthesis has a thread, so that no other node of the process waits for it.
            self._synthesis = threading.Thread(target=self._synthesise, args=(load_voice(voice),))
            self._synthesis.start()
        self.every(0.05, self._pace)
        self.waits_for("the rest of the graph" if self._once else "text on say")

    def destroy_node(self) -> None:
        """Finish the sentence that is being synthesised; the rest is not spoken."""
        while not self._texts.empty():
            self._texts.get()
        self._texts.put(None)
        if self._synthesis:
            self._synthesis.join()
        super().destroy_node()

    def _synthesise(self, voice: Voice) -> None:
        voice.speak("ready")  # the first text loads dictionaries
        while (text := self._texts.get()) is not None:
            try:
                self._utterances.put(voice.speak(text))
            except GestureBotError as error:
                self.get_logger().error(f"say: {error}")

    def _pace(self) -> None:
        """Publish what is due; what is played once waits for the graph, and ends it."""
        if self._once and not self._utterance and not all(map(self.count_subscribers, GRAPH)):
            return
        while not self._utterances.empty():
            self._begin(self._utterances.get())
        now = self.now()
        while self._pieces and seconds(self._pieces[0].header.stamp) - self._lead <= now:
            self._audio.publish(self._pieces.popleft())
        if self._once and now > self._free_at + LAST_RETRACTION:
            self.context.try_shutdown()

    def _begin(self, utterance: Utterance) -> None:
        """Put an utterance behind those before it; its words are published at once."""
        start = frame_time(first_frame_after(max(self.now() + self._start_delay, self._free_at)))
        self._free_at = start + len(utterance.samples) / SAMPLE_RATE
        self._utterance += 1
        for word in utterance.words:
            spoken = WordMessage(text=word.text, duration=word.end - word.start, confidence=1.0)
            spoken.header.stamp = stamp(start + word.start)
            spoken.stress = word.stress - word.start
            self._words.publish(spoken)
        for first in range(0, len(utterance.samples), PIECE):
            piece = Audio(utterance=self._utterance, sample_rate=SAMPLE_RATE)
            piece.header.stamp = stamp(start + first / SAMPLE_RATE)
            piece.header.frame_id = "voice"
            piece.samples.frombytes(utterance.samples[first : first + PIECE].astype(np.float32).tobytes())
            piece.last = first + PIECE >= len(utterance.samples)
            self._pieces.append(piece)
