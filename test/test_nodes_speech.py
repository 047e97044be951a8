"""The node speech_source by itself: its voice follows the emotion, and a recording has its words."""

import sysconfig
from pathlib import Path

import numpy as np
import pytest
import soundfile
from conftest import running, wait_until
from std_msgs.msg import String

from gesture_bot.matching.emotions import load_emotions
from gesture_bot.msg import Emotion
from gesture_bot.nodes.node import PLAN, STATE
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.voice import load_voice

pytestmark = pytest.mark.live

EXECUTABLE = Path(sysconfig.get_path("data")) / "lib" / "gesture_bot" / "speech_source"
TEXT = "We count the boats on the river."


def source(**parameters):
    """The node, in a process."""
    given = [part for name, value in parameters.items() for part in ("-p", f"{name}:={value}")]
    return running([str(EXECUTABLE), "--ros-args", *given])


def spoken(record):
    """Length of what was said, from the first word's begin to the last one's end, and its words."""
    words = [heard.message for heard in record.words]
    first, last = record.words[0], record.words[-1]
    return last.stamp + last.message.duration - first.stamp, [word.text for word in words]


def test_the_voice_follows_the_emotion(listener):
    voices = {name: emotion.voice for name, emotion in load_emotions().items()}
    emotions = listener.create_publisher(Emotion, "emotion", STATE)
    say = listener.create_publisher(String, "say", PLAN)
    record = listener.record
    lengths = {}
    with source(emotion="furious"):
        wait_until(say.get_subscription_count, 30, "the node on say")
        wait_until(lambda: emotions.get_subscription_count() >= 2, 10, "the node on emotion")
        for name in ("furious", "sad", "no emotion of ours"):
            if name != "furious":  # the parameter said so
                emotions.publish(Emotion(expression=name))
                listener.create_rate(2).sleep()
            record.words.clear()
            say.publish(String(data=TEXT))
            wait_until(lambda: len(record.words) == 7, 20, f"the words, {name}")
            lengths[name], _ = spoken(record)
    voice = load_voice("embedded")
    for name in ("furious", "sad"):
        words = voice.speak(TEXT, voices[name]).words
        assert lengths[name] == pytest.approx(words[-1].end - words[0].start, abs=0.001)
    assert lengths["sad"] > 1.1 * lengths["furious"]
    assert lengths["no emotion of ours"] == pytest.approx(lengths["sad"], abs=0.001), "the one before stays"


def test_a_recording_with_its_text_has_its_words(listener, tmp_path):
    utterance = load_voice("embedded").speak(TEXT)
    soundfile.write(tmp_path / "talk.wav", utterance.samples, SAMPLE_RATE)
    with source(speech=tmp_path / "talk.wav", text=TEXT) as process:
        assert process.wait(40) == 0, process.stdout.read()
    record = listener.record
    assert spoken(record)[1] == [word.text for word in utterance.words]
    begin = record.audio[0].stamp
    for heard, word in zip(record.words, utterance.words, strict=True):
        assert heard.stamp - begin == pytest.approx(word.start, abs=0.1)
        assert heard.message.stress == pytest.approx(word.stress - word.start, abs=0.15)
    heard = np.concatenate([np.asarray(heard.message.samples) for heard in record.audio])
    np.testing.assert_allclose(heard, utterance.samples, atol=1e-4)
