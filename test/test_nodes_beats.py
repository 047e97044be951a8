"""Beats on the topics: the feature streamer tells them, and the selector moves on them."""

import sysconfig
import time
from pathlib import Path

import numpy as np
import pytest
from conftest import running, wait_until
from small_database import small_database

from gesture_bot.base.frames import FRAME_RATE, first_frame_after, frame_time
from gesture_bot.msg import Audio, SpeechFeatures
from gesture_bot.nodes.messages import clip_from
from gesture_bot.nodes.node import STREAM, stamp
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.beats import Intervals, speech_beats
from gesture_bot.speech.voice import load_voice

pytestmark = pytest.mark.live

EXECUTABLES = Path(sysconfig.get_path("data")) / "lib" / "gesture_bot"


@pytest.mark.parametrize(("language", "intervals"), [("en", Intervals()), ("zh", Intervals(0.3, 0.6))])
def test_the_streamer_tells_the_beats_of_the_sound(listener, language, intervals):
    samples = load_voice("embedded").speak("We count the boats on the river, one after another.").samples
    samples = samples.astype(np.float32)
    with running([str(EXECUTABLES / "feature_streamer"), "--ros-args", "-p", f"language:={language}"]):
        audio = listener.create_publisher(Audio, "speech/audio", STREAM)

        def try_it():
            message = Audio(sample_rate=SAMPLE_RATE, samples=[0.0] * 1600, last=True)
            message.header.stamp = stamp(listener.now())
            audio.publish(message)
            return listener.record.features

        # Sound and features are best effort: until all are connected, some is lost.
        wait_until(try_it, 20, "the streamer")
        time.sleep(0.5)
        listener.record.features.clear()
        begin = frame_time(first_frame_after(time.time() + 1))
        starts = range(0, len(samples), 1600)
        for start in starts:
            piece = Audio(
                utterance=1, sample_rate=SAMPLE_RATE, samples=samples[start : start + 1600].tolist()
            )
            piece.header.stamp = stamp(begin + start / SAMPLE_RATE)
            piece.last = start == starts[-1]
            audio.publish(piece)
            time.sleep(0.02)
        frames = -(-len(samples) * FRAME_RATE // SAMPLE_RATE)
        wait_until(lambda: len(listener.record.features) >= frames, 10, "all features")
    told = [heard.stamp + beat - begin for heard in listener.record.features for beat in heard.message.beats]
    np.testing.assert_allclose(told, speech_beats(samples, intervals), atol=2e-3)


@pytest.mark.parametrize("align", [True, False])
def test_the_selector_moves_on_the_beats_it_is_told(listener, tmp_path, align):
    database = small_database()
    database.save(tmp_path / "small.safetensors")
    options = [f"database:={tmp_path / 'small.safetensors'}", "emotion:=angry"]
    options += [f"align_beats:={align}".lower()]
    arguments = [part for option in options for part in ("-p", option)]
    with running([str(EXECUTABLES / "gesture_selector"), "--ros-args", *arguments]):
        features = listener.create_publisher(SpeechFeatures, "speech/features", STREAM)
        wait_until(lambda: listener.record.selected and features.get_subscription_count(), 30, "the selector")
        first = first_frame_after(time.time() + 1)
        for frame in range(first, first + 90):
            vector = np.random.default_rng(frame - first).normal(size=28).astype(np.float32)
            vector[13] = -20.0
            message = SpeechFeatures(features=vector, speech=True)
            message.header.stamp = stamp(frame_time(frame))
            message.beats = [0.03] if frame % 5 == 0 else []
            features.publish(message)
            time.sleep(0.002)
        wait_until(lambda: listener.now() > frame_time(first + 80), 20, "six seconds of speech")
    windows = [heard.message for heard in listener.record.selected if heard.message.source == "speech"]
    assert len(windows) > 6
    recorded = 0
    for window in windows:
        row = database.starts[window.sequence] + window.frame
        clip = clip_from(window).keypoints
        recorded += np.allclose(clip, database.keypoints[row : row + len(clip)], atol=1e-5)
    assert recorded < 0.7 * len(windows) if align else recorded == len(windows)
