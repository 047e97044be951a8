"""Sound cards that are not there, and speech that is heard live: from the topics to the measured joints."""

import os
import re
import time

import numpy as np
import pytest
from conftest import command, running, wait_until

from gesture_bot.cli.measured import planned_joints
from gesture_bot.evaluate.lag import motion_lag
from gesture_bot.msg import Audio
from gesture_bot.nodes.node import STREAM, stamp
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.voice import load_voice

pytestmark = pytest.mark.live

BLOCK = 512


@pytest.fixture
def no_sound_card(monkeypatch):
    """A machine without a sound card and without a sound server, and maybe without PortAudio."""
    monkeypatch.setenv("PULSE_SERVER", f"unix:{os.devnull}")


@pytest.fixture
def graph(listener, demo_corpus, no_sound_card):
    with running(command("run", "microphone:=default")) as process:
        wait_until(lambda: listener.record.joint_states and listener.record.refined, 40, "the graph to move")
        listener.process = process
        yield listener


def speak_live(node, samples):
    """As a microphone does: each block when it has been heard."""
    audio = node.create_publisher(Audio, "speech/audio", STREAM)
    wait_until(audio.get_subscription_count, 10, "the feature streamer")
    begin = node.now()
    for first in range(0, len(samples), BLOCK):
        block = samples[first : first + BLOCK]
        time.sleep(max(0.0, begin + (first + len(block)) / SAMPLE_RATE - node.now()))
        message = Audio(utterance=1, sample_rate=SAMPLE_RATE, last=first + BLOCK >= len(samples))
        message.header.stamp, message.header.frame_id = stamp(begin + first / SAMPLE_RATE), "somebody"
        message.samples.frombytes(block.astype(np.float32).tobytes())
        audio.publish(message)
    return begin


def holds(node, since):
    """Whether a servo has not answered since then, as where the virtual bus waits for its turn: all hold."""
    told = (s for heard in node.record.diagnostics if heard.arrival > since for s in heard.message.status)
    return any("does not answer" in status.message for status in told)


def test_live_speech_moves_the_joints_one_look_ahead_later(graph):
    text = "Today the river is calm, and an old boat goes slowly past the houses of the town. We go along."
    said = load_voice("embedded").speak(text).samples
    for _attempt in range(3):
        begin = speak_live(graph, said)
        end = begin + len(said) / SAMPLE_RATE
        time.sleep(2.0)
        if not holds(graph, begin):
            break
    record = graph.record
    look_ahead = record.states[-1].message.look_ahead
    spoken = [h for h in record.selected if h.message.source == "speech" and h.arrival > begin]
    assert begin + look_ahead - 1.0 < spoken[0].stamp < begin + look_ahead + 0.6
    assert all(heard.arrival < heard.stamp for heard in spoken)
    assert record.states[-1].message.late == 0

    times, positions = record.joint_positions()
    planned_times, planned = planned_joints(record)
    lags = []
    for first in np.arange(begin + look_ahead, end, 2.0):
        part = (times >= first) & (times < first + 2.0)
        lags.append(motion_lag(times[part], positions[part], planned_times, planned))
    lags = [lag for lag in lags if lag is not None]
    assert len(lags) >= 2
    assert np.median(lags) < 0.1


def test_without_a_sound_card_one_line_says_so_and_all_else_goes_on(graph):
    graph.process.terminate()
    output = graph.process.stdout.read()
    for what in ("speech is not played", "nobody is heard"):
        lines = [line for line in output.splitlines() if what in line]
        assert len(lines) == 1
        assert re.search("no sound card can be used|there is no|cannot be opened", lines[0])
    assert "Traceback" not in output


def test_sound_from_a_topic_needs_the_package(no_sound_card):
    with running(command("run", "microphone:=topic")) as process:
        output = process.stdout.read()
        assert process.wait(40) == 1
    assert "needs the ROS package audio_common_msgs, which is not installed" in output
