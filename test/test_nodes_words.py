"""From sound without words to keywords, through the two nodes between them, while their banks change."""

import sysconfig
import time
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
import soxr
from conftest import running, wait_until

from gesture_bot.msg import Audio
from gesture_bot.nodes.node import STREAM, stamp
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.voice import load_voice

pytestmark = pytest.mark.live

EXECUTABLES = Path(sysconfig.get_path("data")) / "lib" / "gesture_bot"
RATE = 44_100
BANK = """
gestures:
  halt:
    triggers: [wait a minute, danger, dangerous]
    keyframes:
      - {time: 0.0, right: chest}
"""


@pytest.fixture
def nodes(tmp_path):
    """The two nodes and their banks."""
    (tmp_path / "mine.yaml").write_text(BANK)
    with ExitStack() as stack:
        processes = [
            stack.enter_context(running([str(EXECUTABLES / name), "--ros-args", "-p", f"banks:={tmp_path}"]))
            for name in ("word_recogniser", "keyword_spotter")
        ]
        yield tmp_path / "mine.yaml", processes


class Microphone:
    """Publishes sound at the pace at which it is heard."""

    def __init__(self, node):
        self.node, self.utterance = node, 0
        self.publisher = node.create_publisher(Audio, "speech/audio", STREAM)
        # The listener of the tests listens to both, too.
        wait_until(lambda: node.count_subscribers("speech/audio") > 1, 30, "the recogniser")
        wait_until(lambda: node.count_subscribers("speech/words") > 1, 30, "the spotter")
        time.sleep(0.5)  # until all are connected
        said = load_voice("embedded").speak("Please wait a minute, the old bridge is dangerous.").samples
        self.samples = soxr.resample(np.pad(said, (0, SAMPLE_RATE)), SAMPLE_RATE, RATE)

    def speak(self, source):
        self.utterance += 1
        begin = self.node.now()
        for first in range(0, len(self.samples), RATE // 10):
            piece = self.samples[first : first + RATE // 10]
            audio = Audio(utterance=self.utterance, sample_rate=RATE, samples=piece.tolist())
            audio.header.stamp, audio.header.frame_id = stamp(begin + first / RATE), source
            audio.last = first + len(piece) == len(self.samples)
            self.publisher.publish(audio)
            time.sleep(max(0.0, begin + (first + len(piece)) / RATE - self.node.now()))
        return begin


def test_a_microphone_is_understood_and_a_changed_bank_taken_in(nodes, listener):
    bank, (_, spotter) = nodes
    microphone, record = Microphone(listener), listener.record

    def gestures():
        return [heard.message.gesture for heard in record.keywords]

    begin = microphone.speak("microphone")
    wait_until(lambda: "halt" in gestures(), 20, "a keyword")
    keyword = record.keywords[0]
    assert keyword.message.header.frame_id == "microphone"
    assert keyword.message.utterance == 1
    assert begin < keyword.stamp < begin + len(microphone.samples) / RATE
    assert 0 < keyword.message.confidence < 1

    bank.write_text(BANK + "    unknown: 1\n")
    line = next(line for line in spotter.stdout if "mine.yaml" in line)
    assert "line 3: gestures.halt: has no unknown" in line
    bank.write_text(BANK.replace("halt", "bridge").replace("wait a minute, danger, dangerous", "old bridge"))
    time.sleep(2.5)
    record.keywords.clear()
    microphone.speak("microphone")
    wait_until(lambda: "bridge" in gestures(), 20, "a keyword of the changed bank")
    assert "halt" not in gestures()


def test_the_voice_tells_its_own_words(nodes, listener):
    microphone = Microphone(listener)
    microphone.speak("voice")
    microphone.speak("microphone")
    wait_until(lambda: listener.record.words, 20, "a word")
    assert {heard.message.header.frame_id for heard in listener.record.words} == {"microphone"}
