"""Semantic banks: the gestures that ship, their motion, and mistakes in a bank."""

import numpy as np
import pytest
from small_database import small_database

from gesture_bot.base.errors import FileFormatError
from gesture_bot.base.keypoints import INDEX, bone_lengths
from gesture_bot.corpus.sentences import EVERYDAY
from gesture_bot.matching.banks import load_banks, triggers
from gesture_bot.matching.keyframes import render
from gesture_bot.matching.settling import rest_pose
from gesture_bot.speech.keywords import KeywordSpotter
from gesture_bot.speech.voice import Word

GESTURES = load_banks()
REST = rest_pose(small_database())


def rendered(name, rate=60):
    gesture = GESTURES[name]
    start, end = (
        gesture.keyframes[0].time - gesture.preparation,
        gesture.keyframes[-1].time + gesture.retraction,
    )
    times = np.arange(start, end + 1 / rate, 1 / rate)
    return times, render(gesture, times, gesture.preparation, np.repeat(REST[None], len(times), axis=0))


def at_stroke(name):
    times, keypoints = rendered(name)
    return dict(zip(INDEX, keypoints[np.argmin(np.abs(times))], strict=True))


def test_enough_gestures_and_words():
    assert {"hello", "yes", "no", "you", "me", "big", "small", "stop", "think", "everybody"} <= set(GESTURES)
    assert len(GESTURES) >= 17
    assert len(triggers(GESTURES)) >= 90


def called(sentence):
    spotter = KeywordSpotter(triggers(GESTURES))
    found = spotter.spot(Word(word, 0.0, 0.0, 0.0) for word in sentence.split()) + spotter.flush()
    return [spotted.gesture for spotted in found]


def test_words_call_what_they_mean():
    assert called("Good morning, I want to thank you, and what about you?") == ["hello", "thanks", "you"]
    assert called("Look at me, and come here!") == ["me", "come"]


def test_most_speech_is_left_to_the_search():
    assert called("My name is Toa, I am your guide, and there you can sit.") == []
    assert sum(len(called(sentence)) for sentence in EVERYDAY) < 0.7 * len(EVERYDAY)


@pytest.mark.parametrize("name", GESTURES)
def test_a_gesture_grows_out_of_rest_and_goes_back_without_a_jump(name):
    _, keypoints = rendered(name)
    assert np.allclose(keypoints[[0, -1]], REST, atol=2e-3)
    speed = np.linalg.norm(np.diff(keypoints, axis=0), axis=-1) * 60
    assert speed.max() < 5.0
    assert np.abs(np.diff(speed, axis=0)).max() * 60 < 60.0


@pytest.mark.parametrize("name", GESTURES)
def test_bones_keep_their_lengths(name):
    _, keypoints = rendered(name)
    assert np.allclose(bone_lengths(keypoints), bone_lengths(REST), atol=1e-6)


@pytest.mark.parametrize("name", GESTURES)
def test_hands_stay_out_of_the_trunk(name):
    _, keypoints = rendered(name)
    wrists = keypoints[:, [INDEX["left_wrist"], INDEX["right_wrist"]]]
    assert np.linalg.norm(wrists[..., :2] / (0.10, 0.14), axis=-1).min() > 1


def test_gestures_look_like_what_they_mean():
    hello = at_stroke("hello")
    assert hello["right_wrist"][2] > hello["right_shoulder"][2] > hello["right_elbow"][2]
    assert hello["right_index"][2] > hello["right_wrist"][2]
    width = {
        name: at_stroke(name)["left_wrist"][1] - at_stroke(name)["right_wrist"][1]
        for name in ("big", "small")
    }
    assert width["big"] > 0.9 and width["small"] < 0.25
    assert at_stroke("up")["left_wrist"][2] > at_stroke("down")["left_wrist"][2] + 0.3
    assert at_stroke("stop")["right_wrist"][0] > 0.35
    me = at_stroke("me")
    assert me["right_index"][0] < me["right_wrist"][0] < at_stroke("you")["right_wrist"][0]


def test_the_head_nods_and_shakes():
    assert at_stroke("yes")["head_top"][0] > REST[INDEX["head_top"], 0] + 0.03
    _, keypoints = rendered("no")
    sideways = keypoints[:, INDEX["head_top"], 1] - REST[INDEX["head_top"], 1]
    assert sideways.max() > 0.01 and sideways.min() < -0.01


def test_an_arm_that_is_not_used_keeps_its_motion():
    left = [INDEX[f"left_{part}"] for part in ("shoulder", "elbow", "wrist", "index", "little")]
    _, keypoints = rendered("hello")
    assert np.array_equal(keypoints[:, left], np.broadcast_to(REST[left], keypoints[:, left].shape))


BANK = """
wave:
  triggers: [ahoy, good day]
  keyframes:
    - time: 0.0
      right: {wrist: {forward: 0.4, up: 0.3}, palm: forward, fingers: up out}
    - time: 0.4
      head: {nod: 5}
"""


def read(tmp_path, *banks):
    for number, bank in enumerate(banks):
        (tmp_path / f"bank{number}.yaml").write_text(bank)
    return load_banks(tmp_path)


def test_a_bank_of_ones_own(tmp_path):
    assert triggers(read(tmp_path, BANK)) == {"ahoy": "wave", "good day": "wave"}


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        (
            "palm: forward",
            "palm: sideways",
            "wave.keyframes.0.right.palm.*forward, back, out, in, up, down.*sideways",
        ),
        ("palm: forward", "palm: up down", "palm.*up down"),
        ("forward: 0.4", "forward: 4", "right.wrist.forward.*less than or equal to 1.*got 4"),
        ("fingers:", "thumb:", "right.thumb.*got 'up out'"),
        ("time: 0.4", "time: -0.4", "times.*must rise"),
        ("time: 0.0", "time: 0.1", "the stroke, time 0"),
        ("ahoy", "Ahoy", "wave.triggers.0.*lower-case.*Ahoy"),
        ("ahoy", "yes", "wave.triggers.0.*string.*got True"),
        ("head: {nod: 5}", "left: {wrist: {up: 0.1}, palm: up}", "first keyframe must pose the left arm"),
        ("    - time: 0.4", "  - time: 0.4", "not YAML.*line"),
    ],
)
def test_a_mistake_is_named_with_its_place(tmp_path, old, new, named):
    with pytest.raises(FileFormatError, match=named):
        read(tmp_path, BANK.replace(old, new, 1))


def test_a_trigger_calls_one_gesture(tmp_path):
    with pytest.raises(FileFormatError, match="salute has a trigger of wave.*ahoy"):
        read(tmp_path, BANK, BANK.replace("wave:", "salute:"))
