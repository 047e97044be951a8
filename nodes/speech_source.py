"""The sound that the robot gestures to: text spoken by a voice, or a sound file."""

import queue
import threading
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import numpy as np
from rclpy.action import ActionServer, CancelResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.task import Future
from std_msgs.msg import Header, String

from gesture_bot.action import Speak
from gesture_bot.matching.emotions import find_emotion, load_emotions
from gesture_bot.msg import Audio, Cut, Emotion
from gesture_bot.msg import Word as WordMessage
from gesture_bot.nodes.emotions import listen_to_emotion
from gesture_bot.nodes.node import PLAN, STREAM, GestureNode, diagnostic, stamp
from gesture_bot.speech.alignment import align
from gesture_bot.speech.audio import SAMPLE_RATE, load_audio
from gesture_bot.speech.speaking import Piece, Speaking, Spoken
from gesture_bot.speech.voice import Utterance, Voice, load_voice

GRAPH = ("speech/audio", "speech/features", "gesture/selected", "gesture/refined", "gesture/joint_trajectory")
"""Topics that need a listener before something that is played once may begin."""


CONNECTION = 0.5
"""A listener that is known is connected so much later at most [s]; sound that comes before is lost."""

VOICE, FILE = "voice", "file"
"""Sources of sound: one that tells its words, and a file without."""

LAST_RETRACTION = 1.5
"""From the end of what is played once to the end of the graph, time for the arms to come down [s]."""


class _Text:
    """A text on its way through the voice and the queue to its end, and the goal that asked for it."""

    def __init__(self, text: str, goal: ServerGoalHandle | None = None) -> None:
        self.text, self.goal = text, goal
        self.spoken: Spoken | None = None
        self.told = 0
        self.dropped = False
        self.ended = Future()  # why it was not heard to its end; empty where it was

    def tell(self, now: float) -> None:
        """Report to the goal what has begun to be heard, and whether all of it was."""
        if not self.spoken:
            return
        start = self.spoken.start
        begins = [("", 0.0), *((word.text, word.start) for word in self.spoken.utterance.words)]
        while self.told < len(begins) and start + begins[self.told][1] <= now:
            word, begin = begins[self.told]
            self.told += 1
            if self.goal:
                self.goal.publish_feedback(Speak.Feedback(moment=stamp(start + begin), word=word))
        if self.spoken.end <= now:
            self.ended.set_result("")


class SpeechSource(GestureNode):
    """Publishes sound ahead of the moment at which it is heard, so that gestures have time to prepare."""

    def __init__(self, name: str = "speech_source", **options: Any):
        super().__init__(name, **options)
        speech = self.parameter(
            "speech", "say", "'say' (text on the topic `say`), or a sound file to play once"
        )
        text = self.parameter(
            "text", "", "Text to speak once, or what is said in the sound file; the graph ends behind it"
        )
        voice = self.parameter(
            "voice", "embedded", "Voice that speaks text: embedded, or of the extra espeak, espeak:LANGUAGE"
        )
        emotion = self.parameter("emotion", "neutral", "Emotion at the start: a name of config/emotions.yaml")
        lead = self.parameter(
            "lead", 2.0, "How long before it is heard sound is published at most [s]", bounds=(0.0, 10.0)
        )
        start_delay = self.parameter(
            "start_delay",
            0.8,
            "From the synthesis of a text to its sound, time for a first gesture [s]",
            bounds=(0.0, 10.0),
        )
        self._audio = self.create_publisher(Audio, "speech/audio", STREAM)
        self._words = self.create_publisher(WordMessage, "speech/words", PLAN)
        self._cuts = self.create_publisher(Cut, "speech/cut", PLAN)
        self._speaking = Speaking(lead, start_delay)
        self._texts: list[_Text] = []
        self._goals: dict[bytes, _Text] = {}
        self._to_speak: queue.SimpleQueue[_Text | None] = queue.SimpleQueue()
        self._synthesised: queue.SimpleQueue[tuple[_Text, Utterance | str]] = queue.SimpleQueue()
        self._synthesis: threading.Thread | None = None
        self._server: ActionServer | None = None

        self._emotions = load_emotions()
        self._manner = find_emotion(self._emotions, emotion, 0.0, 0.0).voice
        self._source = VOICE if speech == "say" or text else FILE
        self._once: Utterance | None = None
        self._begun = False
        self._complete_at: float | None = None
        if speech != "say":
            samples = load_audio(speech)
            self._once = Utterance(samples, align(samples, text))
            if text and not self._once.words:
                self.get_logger().warning("the text holds no English word to find in the sound")
        elif text:
            self._once = load_voice(voice).speak(text, self._manner)
        else:
            listen_to_emotion(self, self._on_emotion)
            self.listen(String, "say", lambda message: self._take(_Text(message.data)), PLAN)
            self._server = ActionServer(
                self,
                Speak,
                "speak",
                self._execute,
                handle_accepted_callback=self._accept,
                cancel_callback=self._cancel,
            )
            # Synthesis has a thread, so that no other node of the process waits for it.
            self._synthesis = threading.Thread(
                target=self._synthesise, args=(load_voice(voice),), daemon=True
            )
            self._synthesis.start()
        self.every(0.05, self._pace)
        self.every(1.0, self._report)
        self.waits_for("the rest of the graph" if self._once else "text on say and speak")

    def destroy_node(self) -> None:
        """Finish the sentence that is being synthesised; the rest is not spoken."""
        with suppress(queue.Empty):
            while True:
                self._to_speak.get_nowait()
        self._to_speak.put(None)
        if self._synthesis:
            self._synthesis.join()
        if self._server:
            self._server.destroy()
        super().destroy_node()

    def _synthesise(self, voice: Voice) -> None:
        with suppress(Exception):  # the first text loads dictionaries
            voice.speak("ready")
        while (text := self._to_speak.get()) is not None:
            if text.dropped:
                continue
            try:
                self._synthesised.put((text, voice.speak(text.text, self._manner)))
            except Exception as error:  # whatever a voice says, the texts behind it are spoken
                self._synthesised.put((text, str(error)))

    def _on_emotion(self, message: Emotion) -> None:
        emotion = find_emotion(self._emotions, message.expression, message.valence, message.arousal)
        self._manner = emotion.voice

    def _take(self, text: _Text) -> None:
        self._texts.append(text)
        self._to_speak.put(text)

    def _accept(self, goal: ServerGoalHandle) -> None:
        if goal.request.urgent:
            self._drop(self._texts, "an urgent text came")
        text = self._goals[bytes(goal.goal_id.uuid)] = _Text(goal.request.text, goal)
        self._take(text)
        goal.execute()

    async def _execute(self, goal: ServerGoalHandle) -> Speak.Result:
        """Wait for the end of a text."""
        why = await self._goals.pop(bytes(goal.goal_id.uuid)).ended
        if not why:
            goal.succeed()
        elif goal.is_cancel_requested:
            goal.canceled()
        else:
            goal.abort()
        return Speak.Result(spoken=not why, message=why)

    def _cancel(self, goal: ServerGoalHandle) -> CancelResponse:
        self._drop([text for text in self._texts if text.goal is goal], "it was cancelled")
        return CancelResponse.ACCEPT

    def _drop(self, texts: Sequence[_Text], why: str) -> None:
        """Take back some texts, wherever they are."""
        cut = self._speaking.cut([text.spoken for text in texts if text.spoken], self.now())
        if cut:
            moment, utterance = cut
            self._cuts.publish(Cut(header=_header(moment, self._source), utterance=utterance))
        for text in texts:
            text.dropped = True
            text.ended.set_result(why)
        self._texts = [text for text in self._texts if not text.dropped]

    def _pace(self) -> None:
        """Publish what is due; what is played once waits for the graph, and ends it."""
        now = self.now()
        if self._once and not self._begun:
            # Listeners of a graph that has just ended may still be counted when this one begins to run.
            if self._complete_at is None or not all(map(self.count_subscribers, GRAPH)):
                self._complete_at = now
            if now < self._complete_at + CONNECTION:
                return
            self._begun = True
            self._speaking.put(self._once, now)
        while not self._synthesised.empty():
            text, said = self._synthesised.get()
            if text.dropped:
                continue
            if isinstance(said, Utterance):
                text.spoken = self._speaking.put(said, now)
            else:
                self.fail("say", f"cannot speak {text.text!r} ({said})")
                text.ended.set_result(said)
        for due in self._speaking.due(now):
            if isinstance(due, Piece):
                self._audio.publish(_audio(due, self._source))
            else:
                self._publish_words(due)
        for text in self._texts:
            text.tell(now)
        self._texts = [text for text in self._texts if not text.ended.done()]
        if self._begun and now > self._speaking.end + LAST_RETRACTION:
            self.context.try_shutdown()

    def _report(self) -> None:
        speaks = self._speaking.end > self.now()
        self.diagnose(
            diagnostic(
                "speech source",
                self.errors(),
                "speaks" if speaks else "silent",
                waiting_texts=sum(text.spoken is None for text in self._texts),
            )
        )

    def _publish_words(self, spoken: Spoken) -> None:
        for word in spoken.utterance.words:
            message = WordMessage(text=word.text, duration=word.end - word.start, confidence=1.0)
            message.header, message.utterance = (
                _header(spoken.start + word.start, self._source),
                spoken.number,
            )
            message.stress = word.stress - word.start
            self._words.publish(message)


def _header(moment: float, source: str) -> Header:
    return Header(stamp=stamp(moment), frame_id=source)


def _audio(piece: Piece, source: str) -> Audio:
    message = Audio(utterance=piece.number, sample_rate=SAMPLE_RATE, last=piece.last)
    message.header = _header(piece.moment, source)
    message.samples.frombytes(piece.samples.astype(np.float32).tobytes())
    return message
