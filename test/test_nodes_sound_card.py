"""The loudspeaker and the microphone on a virtual sound card."""

import os
import sysconfig
import time
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
import soxr
from conftest import running, wait_until
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from scipy.signal import correlate

from gesture_bot.msg import Audio, Cut
from gesture_bot.nodes.node import PLAN, STREAM, stamp
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.voice import load_voice

pytestmark = pytest.mark.live

EXECUTABLES = Path(sysconfig.get_path("data")) / "lib" / "gesture_bot"
CARD_RATE = 44_100
PIECE = SAMPLE_RATE // 10


@pytest.fixture
def card(tmp_path, monkeypatch):
    card = Path(__file__).with_name("virtual_sound_card.py").read_text()
    (tmp_path / "sounddevice.py").write_text(card)
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}{os.pathsep}{os.environ.get('PYTHONPATH', '')}")
    monkeypatch.setenv("PLAYED", str(tmp_path / "played"))
    monkeypatch.setenv("BROKEN", str(tmp_path / "broken"))
    return tmp_path


@pytest.fixture
def nodes(card, listener):
    with ExitStack() as stack:
        for name, options in (("loudspeaker", []), ("microphone", ["-p", "microphone:=virtual"])):
            stack.enter_context(running([str(EXECUTABLES / name), "--ros-args", *options]))
        yield listener


def say(node, samples, utterance=1):
    """As speech_source does: announced, in pieces; the moment at which it is to be heard."""
    audio = node.create_publisher(Audio, "speech/audio", STREAM)
    listeners = {"loudspeaker", "microphone", node.get_name()}

    def they_alone():
        """A graph of the test before may still be known for a while."""
        names = [one.node_name for one in node.get_subscriptions_info_by_topic("speech/audio")]
        return set(names) == listeners and len(names) == audio.get_subscription_count() == 3

    wait_until(they_alone, 30, "both nodes and no other")
    time.sleep(0.5)
    begin = node.now() + 2.0
    for first in range(0, len(samples), PIECE):
        message = Audio(utterance=utterance, sample_rate=SAMPLE_RATE, last=first + PIECE >= len(samples))
        message.header.stamp, message.header.frame_id = stamp(begin + first / SAMPLE_RATE), "voice"
        message.samples.frombytes(samples[first : first + PIECE].astype(np.float32).tobytes())
        audio.publish(message)
        time.sleep(0.01)
    return begin


def played(card):
    """(n,) moments and (n,) samples."""
    return np.fromfile(card / "played").reshape(-1, 2).T


def heard(node):
    """(n,) moments and (n,) loudness of what came from the microphone."""
    blocks = [h for h in node.record.audio if h.message.header.frame_id == "microphone"]
    return np.array([[h.stamp, np.abs(h.message.samples).max()] for h in blocks]).T


def test_speech_is_heard_at_its_moment_and_not_by_the_microphone(nodes, card):
    said = load_voice("embedded").speak("We count the boats on the river.").samples
    wait_until(lambda: len(heard(nodes)), 30, "the microphone")
    begin = say(nodes, said)
    end = begin + len(said) / SAMPLE_RATE
    wait_until(lambda: nodes.now() > end + 1.5, 20, "the end of the sentence")

    times, sound = played(card)
    # Counted from the sentence: moments since the epoch are too coarse for an even grid. On a fine grid, it
    # does not matter where between two samples of the sentence the card's clock stands.
    fine = 4 * SAMPLE_RATE
    sound = np.interp(np.arange(-0.5, end - begin + 0.5, 1 / fine), times - begin, sound)
    said = soxr.resample(said, SAMPLE_RATE, fine)
    match = correlate(sound, said, "valid")
    assert abs(match.argmax() / fine - 0.5) < 0.03
    around = sound[match.argmax() :][: len(said)]
    assert match.max() > 0.99 * np.linalg.norm(around) * np.linalg.norm(said)

    moments, loudness = heard(nodes)
    during = (moments > begin) & (moments < end)
    assert during.sum() > 20
    assert loudness[during].max() == 0
    assert np.median(loudness[moments < begin - 0.1]) > 0.09
    assert np.median(loudness[moments > end + 0.4]) > 0.09


def test_a_cut_silences_the_loudspeaker_and_opens_the_microphone(nodes, card):
    wait_until(lambda: len(heard(nodes)), 30, "the microphone")
    begin = say(nodes, 0.5 * np.ones(4 * SAMPLE_RATE))
    wait_until(lambda: nodes.now() > begin + 0.5, 20, "speech")
    cuts = nodes.create_publisher(Cut, "speech/cut", PLAN)
    wait_until(lambda: cuts.get_subscription_count() > 1, 10, "both nodes on speech/cut")
    cut = Cut(utterance=1)
    moment = nodes.now()
    cut.header.stamp, cut.header.frame_id = stamp(moment), "voice"
    cuts.publish(cut)
    wait_until(lambda: nodes.now() > moment + 1.5, 10, "silence")
    times, sound = played(card)
    assert np.abs(sound[(times > begin + 0.1) & (times < moment)]).min() > 0.3
    assert np.abs(sound[times > moment + 0.2]).max() == 0
    moments, loudness = heard(nodes)
    assert np.median(loudness[moments > moment + 0.6]) > 0.09


def test_a_sound_card_that_breaks_is_told_and_taken_again(nodes, card):
    def told(name, words):
        statuses = [status for h in nodes.record.diagnostics[-4:] for status in h.message.status]
        return any(status.name.endswith(name) and words in status.message for status in statuses)

    def both_run():
        return told("microphone", "running") and told("loudspeaker", "running")

    wait_until(both_run, 30, "both to run")
    (card / "broken").touch()
    for name in ("microphone", "loudspeaker"):
        wait_until(lambda name=name: told(name, "cannot be opened"), 20, f"{name} to tell")
    (card / "broken").unlink()
    wait_until(both_run, 20, "both to be back")
    nodes.record.audio.clear()
    wait_until(lambda: nodes.record.audio, 10, "sound")
    assert nodes.record.audio[-1].message.utterance > 1


def test_an_inactive_microphone_gives_the_sound_card_back(nodes):
    client = nodes.create_client(ChangeState, "/microphone/change_state")
    assert client.wait_for_service(30.0)

    def change(transition):
        future = client.call_async(ChangeState.Request(transition=Transition(id=transition)))
        wait_until(future.done, 10, "the transition")
        assert future.result().success

    wait_until(lambda: len(heard(nodes)), 30, "the microphone")
    change(Transition.TRANSITION_DEACTIVATE)
    time.sleep(0.5)
    before = len(nodes.record.audio)
    time.sleep(2.5)  # longer than from one look at the device to the next
    assert len(nodes.record.audio) == before
    change(Transition.TRANSITION_ACTIVATE)
    wait_until(lambda: len(nodes.record.audio) > before + 5, 10, "the microphone")
