"""The voice of the extra `espeak`."""

from concurrent.futures import ThreadPoolExecutor

import librosa
import numpy as np
import pytest

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.voice import Manner, load_voice

pytest.importorskip("espeakng_loader", reason="the extra espeak is not installed")

TEXT = "Hello everybody, and welcome to our little robot laboratory. I can talk with my hands!"


@pytest.fixture(scope="module")
def voice():
    return load_voice("espeak")


@pytest.fixture(scope="module")
def utterance(voice):
    return voice.speak(TEXT)


def energy(utterance, start, end):
    return float(np.sum(utterance.samples[int(start * SAMPLE_RATE) : int(end * SAMPLE_RATE)] ** 2.0))


def rms(utterance):
    return np.sqrt(np.mean(utterance.samples**2))


def written(utterance):
    return [word.text for word in utterance.words]


def assert_times_fit(utterance):
    moments = [0.0]
    for word in utterance.words:
        assert word.start < word.stress < word.end
        moments += [word.start, word.end]
    moments.append(len(utterance.samples) / SAMPLE_RATE)
    assert moments == sorted(moments)


@pytest.mark.parametrize(
    ("language", "text", "words"),
    [
        ("en", TEXT, [word.strip(",.!") for word in TEXT.split()]),
        ("en", "I am Dr. Smith, in 2024.", ["I", "am", "Dr", "Smith", "in", "2024"]),
        ("en", "It costs $3.50 - or 25% more!", ["It", "costs", "3.50", "or", "25", "more"]),
        ("en", "He read it—\"It's well-known\" & ...", ["He", "read", "it", "It's", "well-known"]),
        ("en", "\N{GRINNING FACE} hello\0\ud800 \r\n\n you", ["hello", "you"]),
        ("de", "Tag, Herr Dr. Müller. Es ist 10:30!", ["Tag", "Herr", "Dr", "Müller", "Es", "ist", "10:30"]),
        ("ru", "Привет, мир! Сегодня 25 лет.", ["Привет", "мир", "Сегодня", "25", "лет"]),
        ("el", "Καλημέρα σας, τι κάνετε; Καλά.", ["Καλημέρα", "σας", "τι", "κάνετε", "Καλά"]),
        ("hi", "नमस्ते, आप कैसे हैं?", ["नमस्ते", "आप", "कैसे", "हैं"]),
    ],
)  # fmt: skip
def test_words_are_those_of_the_text_in_any_script(language, text, words):
    utterance = load_voice(f"espeak:{language}").speak(text)
    assert written(utterance) == words
    assert_times_fit(utterance)


def test_sound_lies_in_the_words(utterance):
    assert utterance.samples.dtype == np.float32
    spoken = sum(energy(utterance, word.start, word.end) for word in utterance.words)
    assert spoken > 0.95 * energy(utterance, 0, 1e3)


def test_words_read_as_several_span_them_and_words_read_as_one_share(voice):
    i, am, number, years = voice.speak("I am 2024 years.").words
    assert i.end == am.start
    assert 0.1 < am.end - i.start < 0.4
    assert 1.0 < number.end - number.start < years.start - am.end + 0.1


def test_the_pause_between_sentences_is_in_no_word(utterance):
    before, after = utterance.words[8:10]
    assert (before.text, after.text) == ("laboratory", "I")
    assert 0.2 < after.start - before.end < 1
    assert energy(utterance, before.end + 0.05, after.start) < 1e-3 * energy(
        utterance, before.start, before.end
    )


def test_stress_is_on_the_stressed_syllable(voice):
    first, second = (voice.speak(f"They {word} it today.").words[1] for word in ("harvest", "regret"))
    assert first.stress < (first.start + first.end) / 2 < second.stress


@pytest.mark.parametrize("speed", [0.6, 1.5, 2.0])
def test_speed(voice, utterance, speed):
    other = voice.speak(TEXT, Manner(speed=speed))
    assert_times_fit(other)
    assert utterance.words[-1].end / other.words[-1].end == pytest.approx(speed, rel=0.07)


@pytest.mark.parametrize("language", ["en", "de"])
@pytest.mark.parametrize("pitch", [0.75, 1.3])
def test_pitch(language, pitch):
    def fundamental(manner):
        samples = load_voice(f"espeak:{language}").speak(TEXT, manner).samples
        return np.nanmedian(librosa.pyin(samples, fmin=40, fmax=400, sr=SAMPLE_RATE)[0])

    assert fundamental(Manner(pitch=pitch)) / fundamental(Manner()) == pytest.approx(pitch, rel=0.08)


@pytest.mark.parametrize("energy", [0.25, 0.6, 1.5])
def test_energy(voice, utterance, energy):
    assert rms(voice.speak(TEXT, Manner(energy=energy))) / rms(utterance) == pytest.approx(energy, rel=0.02)


def test_it_is_as_loud_as_the_embedded_voice(utterance):
    assert rms(utterance) == pytest.approx(rms(load_voice("embedded").speak(TEXT)), rel=0.3)


def test_voices_in_several_threads_do_not_mix():
    said = [
        ("en", TEXT),
        ("ru", "Привет, мир!"),
        ("de", "Guten Tag, liebe Leute."),
    ] * 4

    def speak(one):
        language, text = one
        return load_voice(f"espeak:{language}").speak(text)

    with ThreadPoolExecutor(6) as pool:
        together = list(pool.map(speak, said))
    for one, utterance in zip(said, together, strict=True):
        alone = speak(one)
        np.testing.assert_array_equal(utterance.samples, alone.samples)
        assert utterance.words == alone.words


@pytest.mark.parametrize("language", ["xx", "english", ""])
def test_an_unknown_language_lists_the_known(language):
    with pytest.raises(InvalidValueError, match="valid: af, .*de.*en.*ru"):
        load_voice(f"espeak:{language}")


@pytest.mark.parametrize("text", ["", "  \n", "?!..."])
def test_nothing_to_speak(voice, text):
    with pytest.raises(InvalidValueError, match="nothing that can be spoken"):
        voice.speak(text)
