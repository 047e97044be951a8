"""The sound that the robot gestures to: text spoken by a voice, or a sound file."""

import queue
import threading
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from std_msgs.msg import String

from gesture_bot.base.errors import GestureBotError
from gesture_bot.base.frames import first_frame_after, frame_time
from gesture_bot.msg import Audio
from gesture_bot.msg import Word as WordMessage
from gesture_bot.nodes.node import PLAN, STREAM, GestureNode, stamp
from gesture_bot.speech.audio import SAMPLE_RATE, load_audio
from gesture_bot.speech.voice import Word, load_voice

PIECE = SAMPLE_RATE // 10
"""Samples in one message: 100 ms."""

GRAPH = ("speech/audio", "speech/features", "gesture/selected", "gesture/refined", "gesture/joint_trajectory")
"""Topics that need a listener before something that is played once may begin."""


class SpeechSource(GestureNode):
    """Publishes sound ahead of the moment at which it is heard, so that gestures have time to prepare."""

    def __init__(self, name: str = "speech_source", **options: Any):
        super().__init__(name, **options)
        speech = self.parameter("speech", "say", "'say' (text on the topic `say`), or a sound file to play once")
        text = self.parameter("text", "", "Text to speak once; the graph ends when it has been spoken")
        voice = self.parameter("voice", "embedded", "Voice that speaks text")
        self._lead = self.parameter(
            "lead", 2.0, "How long before it is heard sound is published [s]", bounds=(0.0, 10.0)
        )
        self._start_delay = self.parameter(
            "start_delay", 0.8, "From the arrival of a text to its sound, time for a first gesture [s]", bounds=(0.0, 10.0)
        )
        self._audio = self.create_publisher(Audio, "speech/audio", STREAM)
        self._words = self.create_publisher(WordMessage, "speech/words", PLAN)
        self._utterance = 0
        self._free_at = 0.0
        self._stopping = threading.Event()
        self._texts: queue.SimpleQueue[str] = queue.SimpleQueue()

        # Synthesis and pacing take their time: they have a thread, so that no other node waits.
        if text or speech == "say":
            self._voice = load_voice(voice)
        if text:
            work = threading.Thread(target=self._play_once, args=(lambda: self._speak(text),), daemon=True)
        elif speech == "say":
            self.listen(String, "say", lambda message: self._texts.put(message.data), PLAN)
            work = threading.Thread(target=self._speak_on_demand, daemon=True)
        else:
            samples = load_audio(Path(speech))
            work = threading.Thread(target=self._play_once, args=(lambda: self._play(samples, ()),), daemon=True)
        self._work = work
        work.start()
        self.waits_for("text on `say`" if speech == "say" and not text else "the rest of the graph")

    def destroy_node(self) -> None:
        """Stop speaking at once."""
        self._stopping.set()
        self._work.join(timeout=1.0)
        super().destroy_node()

    def _speak_on_demand(self) -> None:
        while not self._stopping.is_set():
            try:
                self._speak(self._texts.get(timeout=0.1))
            except queue.Empty:
                pass
            except GestureBotError as error:
                self.get_logger().error(f"say: {error}")

    def _play_once(self, play: Any) -> None:
        while not all(self.count_subscribers(topic) for topic in GRAPH):
            if self._stopping.wait(0.05):
                return
        try:
            play()
        except GestureBotError as error:
            self.get_logger().error(str(error))
        # Leave time for the last retraction.
        self._stopping.wait(self._free_at - self.now() + 1.5)
        self.context.try_shutdown()

    def _speak(self, text: str) -> None:
        utterance = self._voice.speak(text)
        self._play(utterance.samples, utterance.words)

    def _play(self, samples: np.ndarray, words: Iterable[Word]) -> None:
        """Publish words at once and sound `lead` seconds ahead; returns when the last piece is out."""
        start = frame_time(first_frame_after(max(self.now() + self._start_delay, self._free_at)))
        self._free_at = start + len(samples) / SAMPLE_RATE
        for word in words:
            message = WordMessage(text=word.text, duration=word.end - word.start, confidence=1.0)
            message.header.stamp = stamp(start + word.start)
            message.stress = word.stress - word.start
            self._words.publish(message)
        self._utterance += 1
        for first in range(0, len(samples), PIECE):
            heard = start + first / SAMPLE_RATE
            if self._stopping.wait(max(0.0, heard - self._lead - self.now())):
                return
            message = Audio(utterance=self._utterance, sample_rate=SAMPLE_RATE)
            message.header.stamp = stamp(heard)
            message.header.frame_id = "voice"
            message.samples.frombytes(samples[first : first + PIECE].astype(np.float32).tobytes())
            message.last = first + PIECE >= len(samples)
            self._audio.publish(message)
