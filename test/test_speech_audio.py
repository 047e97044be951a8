import numpy as np
import pytest
import soundfile

from gesture_bot.base.errors import FileFormatError
from gesture_bot.speech.audio import SAMPLE_RATE, load_audio


def tone(rate, seconds=0.5):
    return 0.5 * np.sin(2 * np.pi * 440 * np.arange(int(rate * seconds)) / rate)


@pytest.mark.parametrize("rate", [8_000, 16_000, 22_050, 44_100, 48_000])
@pytest.mark.parametrize("channels", [1, 2])
def test_any_rate_and_channel_count_becomes_the_same_signal(tmp_path, rate, channels):
    path = tmp_path / "tone.wav"
    soundfile.write(path, np.column_stack([tone(rate)] * channels), rate)
    samples = load_audio(path)
    assert samples.dtype == np.float32
    assert samples.shape == (SAMPLE_RATE // 2,)
    middle = slice(800, -800)  # the filter of the resampling rings at the ends
    np.testing.assert_allclose(samples[middle], tone(SAMPLE_RATE)[middle], atol=2e-3)


@pytest.mark.parametrize(
    ("name", "subtype"),
    [("a.wav", "PCM_U8"), ("a.wav", "PCM_24"), ("a.wav", "DOUBLE"), ("a.flac", None), ("a.ogg", None)],
)
def test_subtypes_and_other_formats(tmp_path, name, subtype):
    soundfile.write(tmp_path / name, tone(SAMPLE_RATE), SAMPLE_RATE, subtype)
    np.testing.assert_allclose(load_audio(tmp_path / name), tone(SAMPLE_RATE), atol=0.05)


def test_channels_are_averaged(tmp_path):
    path = tmp_path / "stereo.wav"
    soundfile.write(path, np.column_stack([tone(SAMPLE_RATE), np.zeros(SAMPLE_RATE // 2)]), SAMPLE_RATE)
    np.testing.assert_allclose(load_audio(path), tone(SAMPLE_RATE) / 2, atol=1e-3)


def write_text(path):
    path.write_text("RIFF is how a sound file starts\n")


def write_nothing(path):
    path.touch()


def write_no_samples(path):
    soundfile.write(path, np.zeros(0), SAMPLE_RATE)


def write_nan(path):
    soundfile.write(path, np.array([0, np.nan, 0.5]), SAMPLE_RATE, subtype="FLOAT")


@pytest.mark.parametrize(
    ("write", "reason"),
    [
        (write_text, "as sound"),
        (write_nothing, "as sound"),
        (write_no_samples, "no samples"),
        (write_nan, "not finite"),
        (lambda path: None, "no such file"),
        (lambda path: path.mkdir(), "as sound"),
    ],
)
def test_what_is_no_sound_gets_one_clear_line(tmp_path, write, reason):
    path = tmp_path / "speech.wav"
    write(path)
    with pytest.raises(FileFormatError, match=reason) as caught:
        load_audio(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
