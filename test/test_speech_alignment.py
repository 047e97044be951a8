"""Words found in their sound, against the times that voices give themselves."""

import numpy as np
import pytest

from gesture_bot.evaluate.held_sentences import HELD_SENTENCES
from gesture_bot.speech.alignment import align
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.voice import Manner, load_voice

PAUSE = np.zeros(SAMPLE_RATE, np.float32)


@pytest.fixture(scope="module")
def voice():
    return load_voice("embedded")


def errors(utterances, texts):
    """Of each word's start and stress [s]: (2, words)."""
    found = []
    for utterance, text in zip(utterances, texts, strict=True):
        aligned = align(utterance.samples, text)
        assert [word.text for word in aligned] == [word.text for word in utterance.words]
        pairs = zip(aligned, utterance.words, strict=True)
        found += [(one.start - other.start, one.stress - other.stress) for one, other in pairs]
    return np.abs(found).T


@pytest.mark.parametrize("manner", [Manner(), Manner(speed=1.3, pitch=0.7, energy=0.5)])
def test_words_are_where_the_voice_says_them(voice, manner):
    texts = HELD_SENTENCES[:12]
    for error in errors([voice.speak(text, manner) for text in texts], texts):
        assert np.median(error) < 0.04
        assert np.percentile(error, 90) < 0.08


def test_words_of_another_voice_and_accent():
    pytest.importorskip("espeakng_loader", reason="the extra espeak is not installed")
    voice = load_voice("espeak")
    texts = HELD_SENTENCES[:12]
    for error in errors([voice.speak(text) for text in texts], texts):
        assert np.median(error) < 0.03
        assert np.percentile(error, 90) < 0.08


def test_numbers_abbreviations_and_names_that_no_dictionary_has(voice):
    text = "Dr. Xyzwick met R2D2 at 10:30am in 2024, near Kuckucksheim & Co."
    (starts, stresses) = errors([voice.speak(text)], [text])
    assert np.median(starts) < 0.05
    assert stresses.max() < 0.25


def test_a_recording_with_noise_and_pauses(voice):
    texts = HELD_SENTENCES[:8]
    said, starts = [PAUSE], []
    for text in texts:
        utterance = voice.speak(text)
        before = sum(map(len, said)) / SAMPLE_RATE
        starts += [before + word.start for word in utterance.words]
        said += [utterance.samples, PAUSE]
    samples = np.concatenate(said)
    noise = 0.1 * samples.std() * np.random.default_rng(0).standard_normal(len(samples))
    aligned = align(samples + noise, " ".join(texts))
    error = np.abs([word.start for word in aligned] - np.array(starts))
    assert np.percentile(error, 95) < 0.12


def test_the_same_sound_gives_the_same_words(voice):
    samples = voice.speak(HELD_SENTENCES[0]).samples
    assert align(samples, HELD_SENTENCES[0]) == align(samples, HELD_SENTENCES[0])


@pytest.mark.parametrize("samples", [PAUSE[:0], PAUSE[:800], PAUSE], ids=len)
def test_sound_that_cannot_be_the_text_has_all_words_and_a_warning(samples, caplog):
    aligned = align(samples, "We count the boats on the river, and then we go home for the night.")
    assert len(aligned) == 15
    assert 0 <= aligned[0].start <= aligned[0].stress <= aligned[-1].end <= len(samples) / SAMPLE_RATE
    assert "does not fit its text" in caplog.text


@pytest.mark.parametrize("text", ["", "?!", "日本語"])
def test_no_words(text):
    assert align(PAUSE, text) == ()
