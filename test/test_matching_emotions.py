"""Emotions: every label of hri_msgs/Expression, and the plane of valence and arousal."""

import numpy as np
import pytest

from gesture_bot.base.errors import FileFormatError, InvalidValueError
from gesture_bot.base.files import config_dir
from gesture_bot.matching.emotions import LABELS, find_emotion, load_emotions
from gesture_bot.speech.voice import Manner

EMOTIONS = load_emotions()


def test_every_label_is_there():
    assert set(EMOTIONS) == set(LABELS)
    assert len(LABELS) == 25


def test_a_label_wins_over_the_plane():
    assert find_emotion(EMOTIONS, "sad", 1.0, 1.0).name == "sad"


@pytest.mark.parametrize("name", LABELS)
def test_each_place_means_its_emotion(name):
    assert find_emotion(EMOTIONS, "", EMOTIONS[name].valence, EMOTIONS[name].arousal).name == name


def test_the_nearest_emotion_is_meant():
    assert find_emotion(EMOTIONS, "", 1.0, 0.4).name == "happy"
    assert find_emotion(EMOTIONS, "", 0.05, -0.05).name == "neutral"


def test_an_unknown_label_is_answered_with_the_known():
    with pytest.raises(InvalidValueError, match="'cheerful'; valid: neutral, .*bored"):
        find_emotion(EMOTIONS, "cheerful", 0.0, 0.0)


def test_activation_makes_motion_faster_and_sadness_smaller():
    arousal, tempo = ([getattr(e, name) for e in EMOTIONS.values()] for name in ("arousal", "tempo"))
    assert np.corrcoef(arousal, tempo)[0, 1] > 0.8
    assert EMOTIONS["neutral"].tempo == EMOTIONS["neutral"].amplitude == 1
    assert EMOTIONS["sad"].amplitude < EMOTIONS["neutral"].amplitude < EMOTIONS["angry"].amplitude


def test_voices_follow_what_is_known_of_emotional_speech():
    """Scherer 2003; Juslin & Laukka 2003: what each measure does from neutral speech on."""
    voices = {name: emotion.voice for name, emotion in EMOTIONS.items()}
    assert voices["neutral"] == Manner()
    for name in ("angry", "furious", "happy", "excited"):
        assert min(voices[name].speed, voices[name].pitch, voices[name].energy) > 1, name
    for name in ("sad", "bored", "tired"):
        assert max(voices[name].speed, voices[name].pitch, voices[name].energy) < 1, name
    arousal = [emotion.arousal for emotion in EMOTIONS.values()]
    for measure in ("speed", "pitch", "energy"):
        assert np.corrcoef(arousal, [getattr(voice, measure) for voice in voices.values()])[0, 1] > 0.8


@pytest.mark.parametrize(("valence", "arousal"), [(float("nan"), 0.0), (0.0, 1.5), (-2.0, 0.0)])
def test_a_place_outside_the_plane_is_refused(valence, arousal):
    with pytest.raises(InvalidValueError, match="-1 to 1"):
        find_emotion(EMOTIONS, "", valence, arousal)


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ("hand: both", "hand: feet", "constraints.0.hand.*left.*right.*both.*feet"),
        ("valence: 0.8", "valence: 8", "happy.valence"),
        ("labels: [happy]", "labels: [glad]", "happy.labels.0.*glad"),
        ("bored:", "dull:", "dull.*neutral"),
        ("value: 20", "value: 20, colour: red", "colour"),
        ("tempo: 1.1", "tempo: 3.0", "happy.tempo"),
        ("amplitude: 1.15", "amplitude: 0", "happy.amplitude"),
        ("pitch: 1.15", "pitch: 15", "happy.voice: pitch.*0.5 to 2.0"),
        ("pitch: 1.15", "tone: 1.15", "happy.voice.tone"),
        (
            "{quantity: wrist_asymmetry,",
            "{quantity: wrist_asymmetry, hand: left,",
            "horrified.constraints.1: hand.*'left'; valid: both",
        ),
    ],
)
def test_a_file_with_a_mistake_says_where(tmp_path, old, new, named):
    path = tmp_path / "emotions.yaml"
    path.write_text((config_dir() / "emotions.yaml").read_text().replace(old, new, 1))
    with pytest.raises(FileFormatError, match=named):
        load_emotions(path)


def test_a_file_that_lacks_an_emotion_says_which(tmp_path):
    path = tmp_path / "emotions.yaml"
    path.write_text("neutral: {valence: 0, arousal: 0, labels: [neutral]}")
    with pytest.raises(FileFormatError, match="missing: angry, sad"):
        load_emotions(path)
