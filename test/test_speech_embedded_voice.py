import sys

import librosa
import numpy as np
import pytest

from gesture_bot.base.errors import GestureBotError, InvalidValueError
from gesture_bot.speech import embedded_voice, espeak
from gesture_bot.speech.alignment import align
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.voice import Manner, load_voice

TEXT = "Hello everybody, and welcome to our little robot laboratory. I can talk with my hands!"


@pytest.fixture(scope="module")
def voice():
    return load_voice("embedded")


@pytest.fixture(scope="module")
def utterance(voice):
    return voice.speak(TEXT)


def energy(utterance, start, end):
    return float(np.sum(utterance.samples[int(start * SAMPLE_RATE) : int(end * SAMPLE_RATE)] ** 2.0))


def written(utterance):
    return [word.text for word in utterance.words]


def assert_times_fit(utterance):
    moments = [0.0]
    for word in utterance.words:
        assert word.start < word.stress < word.end
        moments += [word.start, word.end]
    moments.append(len(utterance.samples) / SAMPLE_RATE)
    assert moments == sorted(moments)


def test_samples(utterance):
    assert utterance.samples.dtype == np.float32
    assert utterance.samples.ndim == 1
    assert 0.1 < np.abs(utterance.samples).max() <= 1


def test_words_are_those_of_the_text(utterance):
    assert written(utterance) == [word.strip(",.!") for word in TEXT.split()]


def test_words_follow_each_other_inside_the_samples(utterance):
    assert_times_fit(utterance)
    assert all(0.03 < word.end - word.start < 1.2 for word in utterance.words)


def test_sound_lies_in_the_words(utterance):
    everything = energy(utterance, 0, len(utterance.samples) / SAMPLE_RATE)
    spoken = sum(energy(utterance, word.start, word.end) for word in utterance.words)
    assert spoken > 0.85 * everything
    assert energy(utterance, 0, utterance.words[0].start) < 0.02 * everything
    assert energy(utterance, utterance.words[-1].end, 1e3) < 1e-3 * everything


def test_pause_between_sentences_is_silent(utterance):
    before, after = utterance.words[8:10]
    assert (before.text, after.text) == ("laboratory", "I")
    assert 0.2 < after.start - before.end < 1
    assert energy(utterance, before.end, after.start - 0.05) < 1e-4 * energy(
        utterance, before.start, before.end
    )


def test_stressed_vowels_are_loud(utterance):
    level = energy(utterance, 0, 1e3) / len(utterance.samples)
    louder = [
        energy(utterance, word.stress - 0.02, word.stress + 0.02) / (0.04 * SAMPLE_RATE) > level
        for word in utterance.words
    ]
    assert np.mean(louder) > 0.8


def test_closure_of_a_stop_lies_where_the_times_say(voice):
    """The lips close for the p of `apart` shortly before its stressed vowel; the sound is quietest there."""
    utterance = voice.speak("We are never apart again.")
    word, step = utterance.words[3], 0.01
    moments = np.arange(word.start, word.stress, step)
    quietest = moments[np.argmin([energy(utterance, moment, moment + step) for moment in moments])]
    assert 0.02 < word.stress - quietest < 0.16


def test_stress_is_on_the_stressed_syllable(voice):
    first, second = (voice.speak(f"They {word} it today.").words[1] for word in ("harvest", "regret"))
    assert first.stress < (first.start + first.end) / 2 < second.stress


def test_same_text_same_samples(voice, utterance):
    again = load_voice("embedded").speak(TEXT)
    np.testing.assert_array_equal(again.samples, utterance.samples)
    assert again.words == utterance.words == voice.speak(TEXT).words


@pytest.mark.parametrize("speed", [0.6, 1.1, 1.8])
def test_speed_shortens_everything_alike(voice, utterance, speed):
    other = voice.speak(TEXT, Manner(speed=speed))
    assert_times_fit(other)
    assert written(other) == written(utterance)
    for word, plain in zip(other.words, utterance.words, strict=True):
        assert word.stress == pytest.approx(plain.stress / speed, abs=0.02)
    aligned = align(other.samples, TEXT)
    assert np.median([abs(a.start - w.start) for a, w in zip(aligned, other.words, strict=True)]) < 0.05
    assert rms(other) == pytest.approx(rms(utterance), rel=0.2)
    assert fundamental(other) == pytest.approx(fundamental(utterance), rel=0.1)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("Meet Dr. Smith at 10:30am in 2024.", ["Meet", "Dr", "Smith", "at", "10:30am", "in", "2024"]),
        ("It costs $3.50 - or 25% more!", ["It", "costs", "3.50", "or", "25", "more"]),
        ("Call 555-1234 now", ["Call", "555-1234", "now"]),
        ("He read it—really?", ["He", "read", "it", "really"]),
        ("\"Henry VIII\" & a well-known (twice)...", ["Henry", "VIII", "a", "well-known", "twice"]),
        ("hello 日本語 \N{GRINNING FACE}, world", ["hello", "world"]),
        ("One.\n\n?!\n\nTwo.", ["One", "Two"]),
    ],
)  # fmt: skip
def test_words_that_are_read_differently_keep_their_writing(voice, text, words):
    utterance = voice.speak(text)
    assert written(utterance) == words
    assert_times_fit(utterance)


def test_word_read_as_several_spans_them(voice):
    time, year = (word for word in voice.speak("At 10:30am in 2024, yes.").words if word.text[0].isdigit())
    assert time.end - time.start > 0.6
    assert year.end - year.start > 0.6


@pytest.mark.parametrize("text", ["", "  \n", "?!...", "日本語"])
def test_nothing_to_speak(voice, text):
    with pytest.raises(InvalidValueError, match="nothing that can be spoken"):
        voice.speak(text)


def fundamental(utterance):
    """Median f0 of the voiced frames [Hz]."""
    return np.nanmedian(librosa.pyin(utterance.samples, fmin=60, fmax=500, sr=SAMPLE_RATE)[0])


def envelope(utterance):
    """Mean spectrum, smooth over frequency, where the formants are [dB]: (bands,)."""
    power = librosa.feature.melspectrogram(y=utterance.samples, sr=SAMPLE_RATE, n_mels=20, fmin=300)
    return 10 * np.log10(power.mean(axis=1))


def rms(utterance):
    return np.sqrt(np.mean(utterance.samples**2))


@pytest.mark.parametrize("pitch", [0.7, 1.3])
def test_pitch_moves_the_fundamental_and_nothing_else(voice, utterance, pitch):
    other = voice.speak(TEXT, Manner(pitch=pitch))
    assert fundamental(other) / fundamental(utterance) == pytest.approx(pitch, rel=0.05)
    assert rms(other) == pytest.approx(rms(utterance), rel=0.2)
    assert other.words == utterance.words
    assert np.abs(envelope(other) - envelope(utterance)).mean() < 2.5, "the formants moved"


@pytest.mark.parametrize("energy", [0.25, 0.6, 1.5])
def test_energy_scales_the_amplitude(voice, utterance, energy):
    assert rms(voice.speak(TEXT, Manner(energy=energy))) / rms(utterance) == pytest.approx(energy, rel=0.02)


def test_the_loudest_of_all_is_not_clipped(voice):
    samples = voice.speak(TEXT, Manner(pitch=0.5, energy=2.0)).samples
    assert 0.7 < np.abs(samples).max() < 1


@pytest.mark.parametrize("name", ["speed", "pitch", "energy"])
@pytest.mark.parametrize("value", [0, -1, 2.5, float("nan")])
def test_impossible_manner(name, value):
    with pytest.raises(InvalidValueError, match=rf"{name}.*valid: 0\.\d+ to 2\.0"):
        Manner(**{name: value})


@pytest.mark.parametrize("name", ["emma", "", "Embedded"])
def test_unknown_voice_lists_the_known(name):
    with pytest.raises(InvalidValueError, match="embedded"):
        load_voice(name)


def test_a_model_without_durations_has_its_words_aligned(monkeypatch, caplog, utterance):
    monkeypatch.setattr(embedded_voice, "DURATIONS", "/Other_output_0")
    other = load_voice("embedded")
    assert "gives no word times" in caplog.text
    aligned = other.speak(TEXT)
    np.testing.assert_array_equal(aligned.samples, utterance.samples)
    assert written(aligned) == written(utterance)
    assert_times_fit(aligned)
    np.testing.assert_allclose(
        [word.start for word in aligned.words], [word.start for word in utterance.words], atol=0.1
    )


def test_a_voice_whose_extra_is_missing_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "espeakng_loader", None)
    monkeypatch.setattr(espeak, "languages", espeak.languages.__wrapped__)  # without its cache
    with pytest.raises(GestureBotError, match="pip install espeakng-loader"):
        load_voice("espeak")
