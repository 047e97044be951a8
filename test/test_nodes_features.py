"""The streamer's node by itself: features and speech activity of one source, utterance after utterance."""

import sysconfig
import time
from pathlib import Path

import numpy as np
import pytest
from conftest import running, wait_until

from gesture_bot.base.frames import FRAME_RATE, first_frame_after, frame_time
from gesture_bot.msg import Audio
from gesture_bot.nodes.node import STREAM, seconds, stamp
from gesture_bot.speech.activity import speech_activity
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.features import speech_features
from gesture_bot.speech.voice import load_voice

pytestmark = pytest.mark.live

EXECUTABLE = Path(sysconfig.get_path("data")) / "lib" / "gesture_bot" / "feature_streamer"

PIECE = 1600


def test_features_and_activity_of_a_source_that_stays_quiet(listener):
    """The second utterance begins at the loudness that the first has ended with."""
    voice = load_voice("embedded").speak("Let us begin with the second one.").samples
    quiet = np.concatenate([np.zeros(SAMPLE_RATE, np.float32), voice * 10 ** (-24 / 20)])
    expected = speech_activity(quiet)
    audio = listener.create_publisher(Audio, "speech/audio", STREAM)
    with running([str(EXECUTABLE)]):
        wait_until(audio.get_subscription_count, 30, "the streamer")
        wait_until(lambda: listener.count_publishers("speech/features"), 10, "features")
        time.sleep(0.5)
        energies = []
        now = frame_time(first_frame_after(listener.now()))
        for number, start in enumerate((now, now + 10.0)):
            listener.record.features.clear()
            for begin in range(0, len(quiet), PIECE):
                message = Audio(
                    utterance=number, sample_rate=SAMPLE_RATE, samples=quiet[begin : begin + PIECE].tolist()
                )
                message.header.frame_id = "microphone"
                message.header.stamp = stamp(start + begin / SAMPLE_RATE)
                message.last = begin + PIECE >= len(quiet)
                audio.publish(message)
                time.sleep(0.02)
            wait_until(lambda: len(listener.record.features) >= len(expected), 10, "each frame")
            heard = [heard.message for heard in listener.record.features]
            moments = [seconds(message.header.stamp) for message in heard]
            assert moments == pytest.approx(start + np.arange(len(expected)) / FRAME_RATE, abs=1e-6)
            assert [message.speech for message in heard] == list(expected)
            energies.append(np.array([message.features[13] for message in heard]))
    np.testing.assert_allclose(energies[0], speech_features(quiet)[:, 13], atol=1e-3)
    first = int(expected.argmax())
    assert energies[1][first : first + 3].max() > energies[0][first : first + 3].max() + 6
