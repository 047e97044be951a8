"""Keywords in time: strokes on their words, one gesture after another, and what follows them."""

import math

import numpy as np
import pytest
from show import DATABASE, EMOTIONS, GESTURES, SPEECH, START, WRISTS, Show, selector

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.frames import FRAME_RATE, KeypointClip, first_frame_after, frame_time
from gesture_bot.base.keypoints import mirror
from gesture_bot.evaluate.motion_report import stroke_time
from gesture_bot.matching.controls import Constraint
from gesture_bot.matching.plan import Window
from gesture_bot.matching.rendering import render
from gesture_bot.matching.selector import REACT
from gesture_bot.matching.settling import Settling, rest_pose
from gesture_bot.matching.strokes import HASTE, Strokes, lead
from gesture_bot.refine.smoothing import WindowSmoother
from gesture_bot.speech.features import SILENCE_FEATURES


@pytest.mark.parametrize("offset", [0.0, 0.013, 0.031, 0.05])
def test_the_stroke_is_planned_a_little_before_its_word(offset):
    show = Show(selector()).run(1.0)
    word = show.now + 1.6 + offset
    show.chooser.add_keyword("big", word)
    show.run(2.0)
    (bank,) = [window for window in show.windows if window.source == "bank"]
    assert bank.name == "big"
    assert bank.stroke == word
    width = bank.keypoints[:, WRISTS[0], 1] - bank.keypoints[:, WRISTS[1], 1]
    times = np.arange(bank.start, bank.stop) / FRAME_RATE
    # The hands come to rest, wide apart, at the end of the stroke; they are half-way in its middle.
    end = word - lead(GESTURES["big"])
    begin = end + GESTURES["big"].keyframes[0].time
    opening = (times > begin) & (times < end)
    middle = np.interp((width[opening].min() + width.max()) / 2, width[opening], times[opening])
    assert middle == pytest.approx((begin + end) / 2, abs=1 / 30)


def test_a_keyword_heard_too_late_is_made_as_soon_as_a_person_could():
    show = Show(selector()).run(1.0)
    word = show.now + 0.3
    show.chooser.add_keyword("stop", word)
    (bank,) = show.tick()[:1]
    assert bank.name == "stop"
    assert bank.start == first_frame_after(show.now + REACT)
    stop = GESTURES["stop"]
    earliest = REACT + HASTE * stop.preparation - stop.movement.first + lead(stop)
    assert bank.stroke - show.now == pytest.approx(earliest, abs=1 / FRAME_RATE)


def test_changed_banks_give_the_gestures_to_come_and_one_that_was_called_is_made():
    show = Show(selector()).run(1.0)
    show.chooser.add_keyword("big", show.now + 1.6)
    show.chooser.set_gestures({"halt": GESTURES["stop"]})
    show.chooser.add_keyword("halt", show.now + 6.0)
    show.run(7.0)
    assert [window.name for window in show.windows if window.source == "bank"] == ["big", "halt"]
    with pytest.raises(InvalidValueError, match="unknown gesture: 'big'; valid: halt"):
        show.chooser.add_keyword("big", show.now + 2.0)


@pytest.mark.parametrize("name", GESTURES)
def test_a_gesture_in_a_hurry_is_no_faster_than_a_person(name):
    show = Show(selector()).run(1.0)
    show.chooser.add_keyword(name, show.now + 0.4)
    show.run(4.0)
    assert "bank" in show.sources
    _, keypoints = smoothed(sorted(show.windows, key=lambda window: window.start))
    speed = np.linalg.norm(np.diff(keypoints[:, WRISTS], axis=0), axis=-1) * FRAME_RATE
    assert speed.max() < 2.0


def test_a_keyword_that_can_only_be_much_too_late_is_dropped():
    show = Show(selector()).run(1.0)
    show.chooser.add_keyword("stop", show.now - 1.0)
    show.run(1.0)
    assert set(show.sources) == {"rest"}


def test_a_gesture_is_finished_and_the_next_one_waits_or_is_dropped():
    show = Show(selector()).run(1.0)
    word = show.now + 1.5
    for name, later in (("stop", 0.0), ("yes", 0.6), ("me", 0.9), ("big", 3.0)):
        show.chooser.add_keyword(name, word + later)
    show.run(6.0)
    strokes = {window.name: window.stroke - word for window in show.windows if window.source == "bank"}
    assert list(strokes) == ["stop", "yes", "big"]
    assert strokes["stop"] == 0
    assert 0.6 < strokes["yes"] < 1.3
    assert strokes["big"] == 3.0


def test_a_gesture_is_not_repeated_within_its_cooldown():
    show = Show(selector()).run(1.0)
    for later in (1.5, 3.0, 8.0):
        show.chooser.add_keyword("hello", frame_time(START) + 1 + later)
    show.run(9.0)
    strokes = [window.stroke - frame_time(START) for window in show.windows if window.source == "bank"]
    assert strokes == pytest.approx([2.5, 9.0])


def test_a_gesture_that_was_dropped_has_no_cooldown():
    show = Show(selector()).run(1.0)
    show.chooser.add_keyword("hello", show.now - 1.0)
    show.chooser.add_keyword("hello", show.now + 1.5)
    show.run(4.0)
    assert "bank" in show.sources


def gesture_in_speech(frames, spoken):
    """Frames from the word to the end of a gesture, whose word is at frame 60 of speech that ends later."""
    show = Show(selector())
    word = START + 90
    show.chooser.add_keyword("me", frame_time(word))
    show.run(12.0, [*SPEECH[:spoken], *[SILENCE_FEATURES] * (frames - spoken)], START + 30)
    bank = [frame for frame, (_, window) in show.seen.items() if window.source == "bank"]
    before, after = (show.seen[frame][1].source for frame in (bank[0] - 1, bank[-1] + 1))
    return bank[-1] + 1 - word, before, after


def test_speech_that_goes_on_cuts_the_retraction_short():
    held = GESTURES["me"].movement.last - lead(GESTURES["me"])
    length, before, after = gesture_in_speech(130, spoken=130)
    assert (before, after) == ("speech", "speech")
    assert length == math.ceil(held * FRAME_RATE)
    # Where the sentence ends with the gesture, the hands go back to rest.
    length, _, after = gesture_in_speech(130, spoken=63)
    assert after == "rest"
    assert length > (held + GESTURES["me"].retraction) * FRAME_RATE


def smoothed(windows):
    """What is seen of windows: the frames' times [s since the epoch] and keypoints."""
    smoother, seen = WindowSmoother(), {}
    for window in windows:
        clip = smoother.push(KeypointClip(window.start, window.keypoints))
        seen = {frame: pose for frame, pose in seen.items() if frame < clip.start}
        seen.update(enumerate(clip.keypoints, clip.start))
    return np.array(sorted(seen)) / FRAME_RATE, np.array([seen[frame] for frame in sorted(seen)])


@pytest.mark.parametrize("emotion", ["neutral", "angry"])
@pytest.mark.parametrize("name", GESTURES)
def test_the_stroke_is_seen_on_its_word(name, emotion):
    word = frame_time(START) + 2.02
    strokes = Strokes(GESTURES)
    strokes.add(name, word)
    timing = strokes.next(START, EMOTIONS[emotion])
    rest = rest_pose(DATABASE)
    before = Window(START, np.repeat(rest[None], timing.begin - START, axis=0), "rest")
    settling = Settling(timing.begin - 1, rest, np.zeros_like(rest), rest)
    times, keypoints = smoothed([before, strokes.window(timing, settling)])
    made = [stroke_time(times, keypoints[:, wrist], word) for wrist in WRISTS]
    assert min(abs(moment - word) for moment in made if moment) < 0.1


def made(*keywords, emotion="neutral", seconds=6.0):
    """The gestures that are made of (name, seconds from the first word, trigger), known 1.5 s ahead."""
    show = Show(selector()).run(1.0)
    show.chooser.set_emotion(emotion)
    word = show.now + 1.5
    for name, later, phrase in keywords:
        show.chooser.add_keyword(name, word + later, phrase)
    show.run(seconds)
    return {window.name: window.stroke - word for window in show.windows if window.source == "bank"}


def test_of_two_gestures_that_overlap_the_heavier_is_made():
    assert GESTURES["think"].weight("think") < GESTURES["big"].weight("big")
    assert made(("think", 0.0, "think"), ("big", 0.5, "big")) == {"big": 0.5}
    assert made(("thanks", 0.0, "thanks"), ("big", 0.2, "big"))["thanks"] == 0.0
    assert made(("think", 0.0, "think"), ("big", 2.5, "big")) == {"think": 0.0, "big": 2.5}
    # The lighter one after it waits, or is dropped.
    assert "think" not in made(("goodbye", 0.0, "goodbye"), ("think", 0.5, "think"))


def interrupted(ahead):
    """A light keyword, and a heavier one for just after it that comes so long before the first one's word."""
    show = Show(selector()).run(1.0)
    word = show.now + 2.0
    show.chooser.add_keyword("think", word, "think")
    show.run(2.0 - ahead)
    show.chooser.add_keyword("no", word + 0.8)
    show.run(4.0)
    _, keypoints = smoothed([Window(min(show.seen), show.keypoints, "rest")])
    acceleration = np.diff(keypoints[:, WRISTS], 2, axis=0) * FRAME_RATE**2
    assert np.linalg.norm(acceleration, axis=-1).max() < 25
    return [window.stroke - word for window in show.windows if window.name == "no"], show


def test_a_heavier_keyword_takes_the_place_of_a_gesture_before_its_stroke():
    (stroke,), show = interrupted(ahead=0.85)
    assert stroke == pytest.approx(0.8)
    # Of the first one no more than its preparation is seen.
    (think,) = [window for window in show.windows if window.name == "think"]
    seen = [frame for frame, (_, window) in show.seen.items() if window is think]
    before = lead(GESTURES["think"]) + HASTE * GESTURES["think"].preparation
    assert frame_time(max(seen)) < think.stroke - before
    # When its own stroke has begun, it is finished first.
    (stroke,), show = interrupted(ahead=0.6)
    assert 1.3 < stroke < 1.5
    assert "think" in {window.name for _, window in show.seen.values()}


def test_an_emotion_colours_the_gestures_that_are_planned_after_it():
    def highest(first, then):
        show = Show(selector()).run(1.0)
        show.chooser.set_emotion(first)
        show.chooser.add_keyword("hello", show.now + 1.5)
        show.run(1.2)
        show.chooser.set_emotion(then)
        show.run(3.0)
        assert "bank" in show.sources
        return show.keypoints[:, WRISTS[1], 2].max()

    assert highest("sad", "sad") < highest("neutral", "neutral") - 0.1
    assert highest("neutral", "sad") == highest("neutral", "neutral")


def test_a_tempo_changes_how_long_a_gesture_is_held():
    rest = rest_pose(DATABASE)
    held = {}
    for emotion in ("sad", "neutral", "angry"):
        strokes = Strokes(GESTURES)
        strokes.add("big", frame_time(START) + 2)
        timing = strokes.next(START, EMOTIONS[emotion])
        window = strokes.window(timing, Settling(timing.begin - 1, rest, np.zeros_like(rest), rest))
        assert timing.stroke == frame_time(START) + 2
        held[emotion] = len(window.keypoints)
    assert held["sad"] > held["neutral"] > held["angry"]


def hand_of(name, pose, low=()):
    """The wrist that a gesture moves most, from a pose (17, 3): 0 left, 1 right."""
    strokes = Strokes(GESTURES)
    strokes.add(name, frame_time(START) + 2)
    timing = strokes.next(START, EMOTIONS["neutral"])
    still = Settling(timing.begin - 1, pose, np.zeros_like(pose), pose)
    moved = strokes.window(timing, still, low).keypoints[:, WRISTS] - pose[WRISTS]
    return int(np.linalg.norm(moved, axis=-1).max(axis=0).argmax())


def test_the_nearer_hand_makes_a_gesture_that_may_be_mirrored():
    rest = rest_pose(DATABASE)
    up = render(GESTURES["promise"], np.zeros(1), 0.6, rest[None])[0]
    assert up[WRISTS[1], 2] > up[WRISTS[0], 2] + 0.15
    assert hand_of("hello", rest) == 1
    assert hand_of("idea", up) == 1
    assert hand_of("hello", mirror(up)) == 0
    assert hand_of("right", mirror(up)) == 1  # it means a side


def test_a_hand_that_is_to_stay_low_leaves_the_gesture_to_the_other():
    rest = rest_pose(DATABASE)
    assert hand_of("hello", rest, low=["right"]) == 0
    assert hand_of("hello", rest, low=["left"]) == 1
    assert hand_of("hello", rest, low=["both"]) == 1
    show = Show(selector()).run(1.0)
    show.chooser.set_controls([Constraint("wrist_height", "at_most", 30, hand="right")])
    show.chooser.add_keyword("hello", show.now + 1.5)
    show.run(3.0)
    height = show.keypoints[:, WRISTS, 2].max(axis=0)
    assert height[0] > height[1] + 0.3


def test_bad_keywords_are_named():
    chooser = selector()
    with pytest.raises(InvalidValueError, match="'juggle'; valid: .*hello"):
        chooser.add_keyword("juggle", frame_time(START))
    with pytest.raises(InvalidValueError, match="nan"):
        chooser.add_keyword("hello", float("nan"))
