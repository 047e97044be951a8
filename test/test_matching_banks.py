"""The gestures that ship: their words, and what they look like in every emotion."""

import numpy as np
import pytest
from show import DATABASE, EMOTIONS, GESTURES, SPEECH, WRISTS, Show, selector

from gesture_bot.base.frames import FRAME_RATE, first_frame_after, frame_time
from gesture_bot.base.keypoints import INDEX, bone_lengths
from gesture_bot.corpus.sentences import EVERYDAY
from gesture_bot.matching.arms import SIDES, reach
from gesture_bot.matching.banks import triggers
from gesture_bot.matching.rendering import render
from gesture_bot.matching.settling import rest_pose
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.features import FEATURES
from gesture_bot.speech.keywords import KeywordSpotter
from gesture_bot.speech.voice import Word, load_voice

REST = rest_pose(DATABASE)
AMPLITUDES = sorted({emotion.amplitude for emotion in EMOTIONS.values()})
MOTIONS = {
    name if motion is gesture else f"{name} {motion.emotions[0]}": motion
    for name, gesture in GESTURES.items()
    for motion in (gesture, *gesture.variants)
}


def rendered(name, amplitude=1.0, rate=60):
    motion = MOTIONS[name]
    start = motion.movement.first - motion.preparation
    times = np.arange(start, motion.movement.last + motion.retraction + 1 / rate, 1 / rate)
    underlying = np.repeat(REST[None], len(times), axis=0)
    return times, render(motion, times, motion.preparation, underlying, amplitude)


def at_stroke(name):
    times, keypoints = rendered(name)
    return dict(zip(INDEX, keypoints[np.argmin(np.abs(times))], strict=True))


def test_enough_gestures_and_words():
    assert len(GESTURES) >= 40
    assert len(triggers(GESTURES)) >= 150
    assert {"hello", "stop", "okay", "dont_know", "me", "you", "here", "everybody", "big", "round"} <= set(
        GESTURES
    )
    assert {"tall", "up", "down", "one_hand", "other_hand", "more", "less", "connect", "one"} <= set(GESTURES)


def called(sentence):
    spotter = KeywordSpotter(triggers(GESTURES))
    found = spotter.spot(Word(word, 0.0, 0.0, 0.0) for word in sentence.split()) + spotter.flush()
    return [spotted.gesture for spotted in found]


def test_words_call_what_they_mean():
    assert called("Good morning, I want to thank you, and what about you?") == ["hello", "thanks", "you"]
    assert called("Look at me, and come here!") == ["me", "come"]
    assert called("On the one hand it is small, on the other hand it is fast.") == [
        "one_hand", "small", "other_hand", "fast",
    ]  # fmt: skip


def test_most_speech_is_left_to_the_search():
    assert called("My name is Toa, I am your guide, and there you can sit.") == []
    voice, spotter, show = load_voice("embedded"), KeywordSpotter(triggers(GESTURES)), Show(selector())
    spoken = set()
    for sentence in EVERYDAY:
        utterance, start = voice.speak(sentence), first_frame_after(show.now + 1.2)
        frames = range(start, start + len(utterance.samples) * FRAME_RATE // SAMPLE_RATE)
        for keyword in spotter.spot(utterance.words) + spotter.flush():
            show.chooser.add_keyword(keyword.gesture, frame_time(start) + keyword.stress, keyword.phrase)
        show.run(len(frames) / FRAME_RATE + 1.2, np.resize(SPEECH, (len(frames), FEATURES)), start)
        spoken.update(frames)
    bank = sum(show.seen[frame][1].source == "bank" for frame in spoken)
    assert 0.1 < bank / len(spoken) < 0.4


@pytest.mark.parametrize("name", MOTIONS)
def test_a_gesture_grows_out_of_rest_and_goes_back_without_a_jump(name):
    _, keypoints = rendered(name)
    assert np.allclose(keypoints[[0, -1]], REST, atol=2e-3)
    speed = np.linalg.norm(np.diff(keypoints, axis=0), axis=-1) * 60
    assert speed[:, WRISTS].max() < 3.5
    assert speed.max() < 5.0
    assert np.abs(np.diff(speed, axis=0)).max() * 60 < 60.0


@pytest.mark.parametrize("amplitude", [AMPLITUDES[0], 1.0, AMPLITUDES[-1]])
@pytest.mark.parametrize("name", MOTIONS)
def test_hands_keep_out_of_the_trunk_and_of_each_other_and_within_reach(name, amplitude):
    _, keypoints = rendered(name, amplitude)
    assert np.allclose(bone_lengths(keypoints), bone_lengths(REST), atol=1e-6)
    wrists = keypoints[:, WRISTS]
    low = wrists[..., 2] < REST[INDEX["neck"], 2]
    assert np.linalg.norm(wrists[low][:, :2] / (0.13, 0.17), axis=-1).min() > 1
    assert np.linalg.norm(wrists[:, 0] - wrists[:, 1], axis=-1).min() > 0.08
    for side in SIDES:
        arm = keypoints[:, INDEX[f"{side}_wrist"]] - keypoints[:, INDEX[f"{side}_shoulder"]]
        assert np.linalg.norm(arm, axis=-1).max() < 0.97 * reach(REST, side)


def test_gestures_look_like_what_they_mean():
    hello = at_stroke("hello")
    assert hello["right_wrist"][2] > hello["right_shoulder"][2] > hello["right_elbow"][2]
    assert hello["right_index"][2] > hello["right_wrist"][2]
    assert at_stroke("hello sad")["right_wrist"][2] < hello["right_wrist"][2] - 0.15
    width = {
        name: at_stroke(name)["left_wrist"][1] - at_stroke(name)["right_wrist"][1]
        for name in ("big", "small")
    }
    assert width["big"] > 0.9 and width["small"] < 0.25
    assert at_stroke("up")["left_wrist"][2] > at_stroke("down")["left_wrist"][2] + 0.3
    assert at_stroke("stop")["right_wrist"][0] > 0.35
    me = at_stroke("me")
    assert me["right_index"][0] < me["right_wrist"][0] < at_stroke("you")["right_wrist"][0]
    assert at_stroke("behind")["right_index"][0] < at_stroke("future")["right_index"][0] - 0.3
    across = [at_stroke(name)["right_wrist"][1] for name in ("one", "two", "three")]
    assert across[0] > across[1] + 0.1 > across[2] + 0.2
    assert at_stroke("one_hand")["left_wrist"][1] > 0.35 and at_stroke("other_hand")["right_wrist"][1] < -0.35


def test_the_head_nods_and_shakes():
    assert at_stroke("yes")["head_top"][0] > REST[INDEX["head_top"], 0] + 0.03
    _, keypoints = rendered("no")
    sideways = keypoints[:, INDEX["head_top"], 1] - REST[INDEX["head_top"], 1]
    assert sideways.max() > 0.01 and sideways.min() < -0.01


def test_an_arm_that_is_not_used_keeps_its_motion():
    left = [INDEX[f"left_{part}"] for part in ("shoulder", "elbow", "wrist", "index", "little")]
    _, keypoints = rendered("hello")
    assert np.array_equal(keypoints[:, left], np.broadcast_to(REST[left], keypoints[:, left].shape))


def test_an_amplitude_makes_a_gesture_larger_or_smaller():
    def width(amplitude):
        _, keypoints = rendered("big", amplitude)
        return (keypoints[:, WRISTS[0], 1] - keypoints[:, WRISTS[1], 1]).max()

    assert width(0.6) < width(1.0) - 0.15
    assert width(1.3) > width(1.0) + 0.05
