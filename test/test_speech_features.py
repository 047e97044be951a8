from time import perf_counter

import numpy as np
import pytest

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.speech import features
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.features import FEATURES, SILENCE_FEATURES, STATIC, FeatureStream, speech_features
from gesture_bot.speech.loudness import LoudnessNormaliser
from gesture_bot.speech.voice import load_voice

TEXT = (
    "Hello everybody, and welcome to our little robot laboratory. Take a picture of the big boat. "
    "I am so happy to see you, and I would like to tell you something about my hands."
)


@pytest.fixture(scope="module")
def speech():
    """Speech in a quiet room: the embedded voice over noise 50 dB below it."""
    samples = load_voice("embedded").speak(TEXT).samples
    return samples + 2e-4 * np.random.default_rng(1).standard_normal(len(samples)).astype(np.float32)


@pytest.fixture(scope="module")
def offline(speech):
    return speech_features(speech)


def streamed(samples, sizes):
    stream, frames, position = FeatureStream(), [], 0
    while position < len(samples):
        size = next(sizes)
        frames.append(stream.push(samples[position : position + size]))
        position += size
    return np.concatenate([*frames, stream.flush()])


def test_one_frame_each_fifteenth_of_a_second(speech, offline):
    assert offline.dtype == np.float32
    assert offline.shape == (-(-len(speech) * 15 // SAMPLE_RATE), FEATURES)
    assert np.isfinite(offline).all()


@pytest.mark.parametrize("sizes", [[1], [7], [159, 0, 1], [160], [1067, 1066], [4001], [10**9]])
def test_stream_equals_offline(speech, offline, sizes):
    few = speech if sizes[0] > 100 else speech[: 2 * SAMPLE_RATE]
    endless = (size for _ in iter(int, 1) for size in sizes)
    expected = offline if few is speech else speech_features(few)
    np.testing.assert_allclose(streamed(few, endless), expected, rtol=1e-5, atol=1e-5)


def test_frames_come_as_soon_as_they_are_heard(speech, offline):
    stream, received = FeatureStream(), 0
    for block in np.split(speech[: SAMPLE_RATE // 160 * 160], SAMPLE_RATE // 160):
        received += len(stream.push(block))
    assert received == 14  # the 15th ends with the second, and its last window 12.5 ms later
    assert len(stream.push(speech[SAMPLE_RATE : SAMPLE_RATE + 280])) == 1


def test_later_sound_does_not_change_earlier_frames(speech, offline):
    changed = speech.copy()
    changed[3 * SAMPLE_RATE :] *= -5
    np.testing.assert_array_equal(speech_features(changed)[:44], offline[:44])


def test_windows_are_those_of_librosa(speech, offline):
    import librosa

    silence = np.zeros(2 * features.WINDOW_LENGTH, np.float32)
    normalised = LoudnessNormaliser().push(np.concatenate([speech, silence]))
    settings = {
        "sr": SAMPLE_RATE,
        "n_fft": features.WINDOW_LENGTH,
        "hop_length": features.HOP,
        "center": False,
    }
    power = librosa.feature.melspectrogram(
        y=normalised, win_length=features.WINDOW_LENGTH, n_mels=features.MELS, **settings
    )
    decibels = librosa.power_to_db(power, amin=10 ** (features.FLOOR / 10), top_db=None)
    mfcc = librosa.feature.mfcc(S=decibels, n_mfcc=13)
    frame_of_window = np.array([15 * (160 * i + 200) // SAMPLE_RATE for i in range(mfcc.shape[1])])
    for frame, actual in enumerate(offline):
        expected = mfcc[:, frame_of_window == frame].mean(axis=1)
        np.testing.assert_allclose(actual[:13], expected, rtol=1e-4, atol=1e-3)


def test_mel_filters_are_those_of_librosa():
    import librosa

    expected = librosa.filters.mel(sr=SAMPLE_RATE, n_fft=features.WINDOW_LENGTH, n_mels=features.MELS)
    np.testing.assert_allclose(features.mel_filters(), expected, rtol=1e-5, atol=1e-9)


def test_energy_of_a_steady_tone():
    """It is no speech, so it keeps its level."""
    tone = 0.1 * np.sin(2 * np.pi * 500 * np.arange(SAMPLE_RATE) / SAMPLE_RATE)
    np.testing.assert_allclose(speech_features(tone)[:-1, 13], 10 * np.log10(0.1**2 / 2), atol=0.01)


def test_derivative_is_the_difference_to_the_frame_before(offline):
    np.testing.assert_allclose(offline[1:, STATIC:], np.diff(offline[:, :STATIC], axis=0), atol=1e-4)
    assert not offline[0, STATIC:].any()


@pytest.mark.parametrize("gain", [0.2, 0.5, 3, 8])
def test_loudness_does_not_matter_after_a_while(speech, offline, gain):
    difference = np.abs(speech_features(gain * speech) - offline)[:, :STATIC] / offline[:, :STATIC].std(
        axis=0
    )
    assert difference[60:].mean() < 0.05
    assert difference[-30:].mean() < 0.03


def test_silence():
    expected = np.tile(SILENCE_FEATURES, (15, 1))
    np.testing.assert_allclose(speech_features(np.zeros(SAMPLE_RATE)), expected, atol=1e-6)


def test_silence_is_not_raised_to_speech(speech, offline):
    """Room noise alone, after zeros, and after speech all stay at least 20 dB under speech."""
    loud = np.percentile(offline[:, 13], 90)
    noise = 1e-3 * np.random.default_rng(2).standard_normal(10 * SAMPLE_RATE)
    assert speech_features(noise)[:, 13].max() < loud - 20
    assert speech_features(np.concatenate([np.zeros(SAMPLE_RATE), noise]))[15:, 13].max() < loud - 20
    assert speech_features(np.concatenate([speech, noise]))[len(offline) :, 13].max() < loud - 20


@pytest.mark.parametrize("count", [0, 1, 399, 1066, 1067, 1068, 16_000, 16_001])
def test_short_signals_lose_no_sample(count):
    assert len(speech_features(np.ones(count, np.float32))) == -(-count * 15 // SAMPLE_RATE)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_bad_samples_are_refused_and_leave_the_stream_as_it_was(speech, offline, bad):
    stream = FeatureStream()
    frames = stream.push(speech[:5000])
    with pytest.raises(InvalidValueError, match="finite"):
        stream.push(np.array([0.1, bad]))
    with pytest.raises(InvalidValueError, match="channel"):
        stream.push(np.zeros((10, 2)))
    frames = np.concatenate([frames, stream.push(speech[5000:]), stream.flush()])
    np.testing.assert_array_equal(frames, offline)


def test_a_frame_costs_less_than_a_millisecond(speech):
    def frames_per_second():
        stream, start = FeatureStream(), perf_counter()
        return sum(len(stream.push(block)) for block in blocks) / (perf_counter() - start)

    blocks = np.array_split(speech, len(speech) // 1067)
    assert max(frames_per_second() for _ in range(3)) > 1000
