"""Speech activity: speech from noise, servos and silence, at once and without a flicker."""

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.frames import FRAME_RATE
from gesture_bot.speech.activity import ActivityStream, speech_activity
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.features import speech_features
from gesture_bot.speech.voice import load_voice

SENTENCES = (
    "The new tram line runs from the harbour to the hospital every seven minutes.",
    "Nobody had told us that the museum closes on Tuesdays.",
    "If the battery runs low, the lamp on my shoulder begins to blink.",
)
PAUSE = 2.5
"""Seconds of silence before each sentence and after the last."""


@pytest.fixture(scope="module")
def scene():
    """Samples, and the frames from the first word to the last of each sentence."""
    pause = np.zeros(round(PAUSE * SAMPLE_RATE), np.float32)
    parts, spans, begin = [pause], [], PAUSE
    for sentence in SENTENCES:
        utterance = load_voice("embedded").speak(sentence)
        moments = begin + utterance.words[0].start, begin + utterance.words[-1].end
        spans.append(tuple(round(moment * FRAME_RATE) for moment in moments))
        begin += len(utterance.samples) / SAMPLE_RATE + PAUSE
        parts += [utterance.samples, pause]
    return np.concatenate(parts), spans


def silent(count, generator):
    return np.zeros(count)


def room(count, generator):
    return sosfilt(butter(1, 500, fs=SAMPLE_RATE, output="sos"), generator.normal(size=count))


def servos(count, generator):
    """Gears that whine at 200 to 800 Hz and their harmonics, over the noise of brushes, in moves of 0.8 s."""
    time = np.arange(count) / SAMPLE_RATE
    speed = np.abs(np.sin(np.pi * time / 0.8)) * (time % 1.6 < 0.8)
    phase = 2 * np.pi * np.cumsum(200 + 600 * speed) / SAMPLE_RATE
    whine = sum(np.sin(k * phase) / k for k in range(1, 9))
    brushes = sosfilt(
        butter(2, (1000, 6000), "band", fs=SAMPLE_RATE, output="sos"), generator.normal(size=count)
    )
    return speed * (whine + brushes)


def tones(count, generator):
    """Chords that are struck and die away."""
    time = np.arange(count) / SAMPLE_RATE
    return sum(np.sin(2 * np.pi * hertz * time) for hertz in (262, 330, 392, 784)) * np.exp(-3 * (time % 0.5))


@pytest.mark.parametrize("level", [-26.0, -50.0])
@pytest.mark.parametrize(
    ("noise", "under"),
    [(silent, 0), (room, 10), (servos, 5), (tones, 15)],
    ids=["silence", "room", "servos", "tones"],
)
def test_speech_is_told_from_noise(scene, noise, under, level):
    samples, spans = scene
    speech = samples * 10 ** (level / 20) / samples[samples != 0].std()
    sound = noise(len(samples), np.random.default_rng(1))
    sound *= 10 ** ((level - under) / 20) / max(sound.std(), 1e-9)
    activity = speech_activity((speech + sound).astype(np.float32))
    silence = np.ones(len(activity), bool)
    for begin, end in spans:
        assert activity[begin : begin + 4].any(), "it begins within 0.27 s"
        first = begin + activity[begin:].argmax()
        assert activity[first : end - 1].mean() > 0.9, "it goes on between words"
        assert not activity[end + 6 : end + 15].any(), "it ends within 0.4 s"
        silence[begin - 3 : end + 6] = False
    assert activity[silence].mean() < 0.02


def test_noise_alone_is_no_speech():
    """The energy of its features is that of speech."""
    for noise in room, servos:
        sound = 0.1 * noise(10 * SAMPLE_RATE, np.random.default_rng(2))
        assert (speech_features(sound)[:, 13] > -51).mean() > 0.3
        assert speech_activity(sound).mean() < 0.03


def test_a_stream_says_the_same_as_soon_as_a_frame_is_over(scene):
    samples = scene[0][: 6 * SAMPLE_RATE]
    whole = speech_activity(samples)
    assert len(whole) == len(speech_features(samples)) == 90
    stream = ActivityStream()
    for size in (7, 160, 1067, 4001):
        frames = [np.zeros(0, bool)]
        for begin in range(0, len(samples), size):
            frames.append(stream.push(samples[begin : begin + size]))
            heard = min(begin + size, len(samples))
            assert sum(map(len, frames)) == heard * FRAME_RATE // SAMPLE_RATE
        # The stream that has ended begins another.
        np.testing.assert_array_equal(np.concatenate([*frames, stream.flush()]), whole)


def test_speech_ends_with_its_signal(scene):
    samples, ((_, end), *_) = scene
    activity = speech_activity(samples[: (end - 5) * SAMPLE_RATE // FRAME_RATE - 300])
    assert activity[-5:-1].all() and not activity[-1]


@pytest.mark.parametrize("count", [0, 1, 511, 512, 1066, 1067, 16_001])
def test_every_frame_of_the_features_is_judged(count):
    samples = np.zeros(count, np.float32)
    assert len(speech_activity(samples)) == len(speech_features(samples))


def test_bad_samples_are_refused_and_leave_the_stream_as_it_was(scene):
    samples = scene[0][: 4 * SAMPLE_RATE]
    stream = ActivityStream()
    frames = [stream.push(samples[:50_000])]
    with pytest.raises(InvalidValueError, match="finite"):
        stream.push(np.array([0.1, np.nan]))
    with pytest.raises(InvalidValueError, match="channel"):
        stream.push(np.zeros((10, 2)))
    frames += [stream.push(samples[50_000:]), stream.flush()]
    np.testing.assert_array_equal(np.concatenate(frames), speech_activity(samples))
