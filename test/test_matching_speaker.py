"""Speakers: another voice in terms of the database's, loud and soft passages, silence."""

import numpy as np
import pytest
import soxr

from gesture_bot.evaluate.held_sentences import HELD_SENTENCES
from gesture_bot.matching.speaker import LEAST_SPEECH, Speaker
from gesture_bot.speech.activity import speech_activity
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.features import COEFFICIENTS, SILENCE_FEATURES, STATIC, FeatureStream, speech_features
from gesture_bot.speech.loudness import LoudnessNormaliser
from gesture_bot.speech.voice import load_voice


@pytest.fixture(scope="module")
def samples():
    """42 s of the embedded voice."""
    voice = load_voice("embedded")
    return np.concatenate([voice.speak(sentence).samples for sentence in HELD_SENTENCES[:12]])


@pytest.fixture(scope="module")
def statistics(samples):
    """What the database would say of the voice."""
    spoken = speech_features(samples)
    static = spoken[spoken[:, COEFFICIENTS] > LEAST_SPEECH, :STATIC]
    return static.mean(axis=0), static.std(axis=0)


def heard(samples, statistics):
    """Features as they are and in terms of the database, and which frames are speech."""
    features, speech = speech_features(samples), speech_activity(samples)
    speaker = Speaker(*statistics)
    brought = np.array([speaker.push(frame, spoken) for frame, spoken in zip(features, speech, strict=True)])
    return features, brought, speech & (features[:, COEFFICIENTS] > LEAST_SPEECH)


def apart(features, statistics):
    """How far the mean is from that of the database's voice [its deviations], the worst of the MFCC."""
    mean, deviation = statistics
    return np.abs((features[:, :STATIC].mean(axis=0) - mean) / deviation)[1:COEFFICIENTS].max()


def test_another_voice_becomes_like_that_of_the_database(samples, statistics):
    deeper = soxr.resample(samples, 4, 5)
    features, brought, spoken = heard(deeper, statistics)
    late = spoken & (np.arange(len(spoken)) > 300)
    assert apart(features[late], statistics) > 0.5
    assert apart(brought[late], statistics) < 0.3 * apart(features[late], statistics)
    np.testing.assert_allclose(brought[late].std(axis=0)[:STATIC], statistics[1], rtol=0.3)


def test_the_voice_of_the_database_stays_as_it_is(samples, statistics):
    features, brought, spoken = heard(samples, statistics)
    difference = np.abs(brought - features)[spoken, :STATIC] / statistics[1]
    assert difference.mean() < 0.15


def test_one_absurd_frame_does_not_spoil_a_speaker(samples, statistics):
    features, speech = speech_features(samples), speech_activity(samples)
    speaker, spoilt = Speaker(*statistics), Speaker(*statistics)
    spoilt.push(np.full(28, 1e30), True)
    brought = [
        [who.push(frame, spoken) for frame, spoken in zip(features, speech, strict=True)]
        for who in (speaker, spoilt)
    ]
    difference = np.abs(np.subtract(*brought))[-150:, :STATIC] / statistics[1]
    assert difference.mean() < 0.2


def test_silence_stays_silence(samples, statistics):
    _, brought, _ = heard(np.concatenate([soxr.resample(samples, 4, 5), np.zeros(SAMPLE_RATE)]), statistics)
    np.testing.assert_allclose(brought[-10:], np.tile(SILENCE_FEATURES, (10, 1)), atol=1e-4)


def test_loud_and_soft_passages_stay_apart(samples, statistics):
    """Passages of 5 s that are 12 dB apart keep more than half of it."""
    second = np.arange(len(samples)) / SAMPLE_RATE
    gain = np.where(second % 10 < 5, 2.0, 0.5)
    _, even, spoken = heard(samples, statistics)
    _, uneven, _ = heard((samples * gain).astype(np.float32), statistics)
    frame = np.arange(len(spoken)) / 15
    rise = (uneven - even)[:, COEFFICIENTS]
    loud, soft = (
        rise[spoken & (frame > 5) & ((frame % 10 < 5) == louder)].mean() for louder in (True, False)
    )
    assert loud - soft > 6


def test_a_speaker_keeps_the_loudness_of_what_was_said_before(samples):
    quiet = samples[: 6 * SAMPLE_RATE] * 10 ** (-24 / 20)
    loudness = LoudnessNormaliser()
    levels = []
    for _ in range(2):
        stream = FeatureStream(loudness)
        energy = np.concatenate([stream.push(quiet), stream.flush()])[:, COEFFICIENTS]
        levels.append(np.percentile(energy[:15], 95))
    assert levels[1] > levels[0] + 3
    assert levels[1] == pytest.approx(np.percentile(energy, 95), abs=4)
