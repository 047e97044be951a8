"""The selector: windows that never stop, speech and silence, keywords on time, emotion and controls."""

import math

import numpy as np
import pytest
from small_database import small_database, sound

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.frames import FRAME_RATE, first_frame_after, frame_time
from gesture_bot.base.keypoints import INDEX
from gesture_bot.matching.banks import load_banks
from gesture_bot.matching.controls import Constraint, Controls
from gesture_bot.matching.emotions import load_emotions
from gesture_bot.matching.selector import STROKE_LEAD, Selector
from gesture_bot.speech.features import SILENCE_FEATURES

DATABASE = small_database()
GESTURES, EMOTIONS = load_banks(), load_emotions()
WRISTS = [INDEX["left_wrist"], INDEX["right_wrist"]]

START = 1_700_000_000 * FRAME_RATE
"""The frame at which every test begins."""

SPEECH = sound(np.random.default_rng(9), 300)[:200]
"""Features of 13 s of speech."""


def selector(**options):
    return Selector(DATABASE, GESTURES, EMOTIONS, **options)


class Show:
    """Runs a selector against a clock of 30 Hz, and keeps what would be seen."""

    def __init__(self, chooser):
        self.chooser = chooser
        self.now = frame_time(START)
        self.windows, self.seen = [], {}

    def run(self, seconds, speech=(), speech_start=None, lead=2.0):
        """Let time pass; speech frames come in `lead` seconds before they are heard."""
        end = self.now + seconds
        coming = dict(enumerate(speech, speech_start or 0))
        while self.now < end:
            for frame in [frame for frame in coming if frame_time(frame) - lead <= self.now]:
                self.chooser.add_features(frame, coming.pop(frame))
            self.tick()
            self.now += 1 / 30
        return self

    def tick(self):
        windows = self.chooser.plan(self.now)
        for window in windows:
            assert window.start >= self.now * FRAME_RATE
            if self.seen:
                assert window.start <= max(self.seen) + 1
                assert window.start - 1 in self.seen
            self.seen = {frame: shown for frame, shown in self.seen.items() if frame < window.start}
            self.seen.update(enumerate(((pose, window) for pose in window.keypoints), window.start))
        self.windows += windows
        return windows

    @property
    def keypoints(self):
        """(n, 17, 3) what was seen."""
        return np.array([self.seen[frame][0] for frame in sorted(self.seen)])

    @property
    def sources(self):
        return [self.seen[frame][1].source for frame in sorted(self.seen)]

    def wrists(self, source):
        """(n, 2, 3) positions and (n, 2) speeds of the wrists at the frames from one source."""
        frames = [source == name for name in self.sources]
        wrists = self.keypoints[:, WRISTS]
        speeds = np.linalg.norm(np.gradient(wrists, 1 / FRAME_RATE, axis=0), axis=-1)
        return wrists[frames], speeds[frames]


def talk(emotion="neutral", controls=(), seconds=13.0, **options):
    chooser = selector(**options)
    chooser.set_emotion(emotion)
    chooser.set_controls(controls)
    return Show(chooser).run(seconds, SPEECH, START + 30)


def test_there_is_always_a_plan_up_to_the_horizon():
    show = Show(selector())
    for _ in range(100):
        show.tick()
        assert frame_time(max(show.seen)) >= show.now + 0.8 - 1e-6
        show.now += 1 / 30
    assert {len(window.keypoints) for window in show.windows} == {8}


def test_silence_is_rest_and_almost_still():
    show = Show(selector()).run(6.0)
    assert set(show.sources) == {"rest"}
    speed = np.linalg.norm(np.diff(show.keypoints, axis=0), axis=-1) * FRAME_RATE
    assert 0.001 < speed.max() < 0.03


def test_speech_is_searched_and_silence_after_it_settles():
    show = Show(selector()).run(12.0, [*SPEECH[:90], *[SILENCE_FEATURES] * 8], START + 30)
    sources = show.sources
    spoken = [index for index, source in enumerate(sources) if source == "speech"]
    first = min(show.seen)
    assert START + 30 - 12 <= first + spoken[0] <= START + 30
    assert START + 120 - 1 <= first + spoken[-1] <= START + 120 + 8
    assert set(sources[spoken[0] : spoken[-1]]) == {"speech"}
    for window in show.windows:
        if window.source == "speech":
            row = DATABASE.starts[window.sequence] + window.frame
            assert np.array_equal(window.keypoints, DATABASE.keypoints[row : row + len(window.keypoints)])
            assert window.candidates >= 1 and window.pose_distance > 0
    assert np.abs(show.keypoints[-1] - show.keypoints[0])[..., WRISTS, :].max() < 0.02


def test_the_way_to_rest_is_smooth():
    show = Show(selector()).run(10.0, [*SPEECH[:60], *[SILENCE_FEATURES] * 8], START + 30)
    end = len(show.sources) - show.sources[::-1].index("speech")
    velocity = np.diff(show.keypoints[end - 3 :], axis=0) * FRAME_RATE
    assert np.abs(np.diff(velocity, axis=0)).max() < 0.25


@pytest.mark.parametrize("lead", [0.0, 0.2, 0.4])
def test_speech_that_comes_late_interrupts_rest(lead):
    show = Show(selector()).run(2.0)
    heard = round(show.now * FRAME_RATE) + 7
    show.run(1.0, SPEECH, heard, lead=lead)
    begin = min(frame for frame, shown in show.seen.items() if shown[1].source == "speech")
    assert begin == pytest.approx(heard + (0.4 - lead) * FRAME_RATE, abs=1)


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
    end = word - STROKE_LEAD
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
    assert bank.start == first_frame_after(show.now + 0.4)
    assert 0.3 < bank.stroke - word < 0.5


def test_a_keyword_that_can_only_be_much_too_late_is_dropped():
    show = Show(selector()).run(1.0)
    show.chooser.add_keyword("stop", show.now - 0.5)
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
    show.chooser.add_keyword("hello", show.now - 0.5)
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
    held = GESTURES["me"].keyframes[-1].time - STROKE_LEAD
    length, before, after = gesture_in_speech(130, spoken=130)
    assert (before, after) == ("speech", "speech")
    assert length == math.ceil(held * FRAME_RATE)
    # Where the sentence ends with the gesture, the hands go back to rest.
    length, _, after = gesture_in_speech(130, spoken=63)
    assert after == "rest"
    assert length > (held + GESTURES["me"].retraction) * FRAME_RATE


def test_a_control_raises_the_wrist():
    constraint = Constraint("wrist_height", "left", "at_least", 85)
    free, controlled = (
        talk(controls=controls).wrists("speech")[0][:, 0, 2] for controls in ((), (constraint,))
    )
    assert controlled.mean() > free.mean()
    assert controlled.mean() > 0.95 * Controls(DATABASE).threshold(constraint)


def test_an_emotion_changes_the_motion_within_two_windows():
    show = Show(selector())
    show.chooser.set_emotion("sad")
    show.run(6.0, SPEECH[:90], START + 30)
    _, sad = show.wrists("speech")
    show.chooser.set_emotion("angry")
    switched = show.now
    show.run(5.0, SPEECH[90:], START + 120)
    for window in show.windows:
        if window.source == "speech" and not switched <= frame_time(window.start) <= switched + 1.4:
            label = DATABASE.emotions[DATABASE.emotion[window.sequence]]
            assert label == ("sad" if frame_time(window.start) < switched else "angry")
    angry = Show(selector())
    angry.chooser.set_emotion("angry")
    assert angry.run(6.0, SPEECH[:90], START + 30).wrists("speech")[1].mean() > 1.5 * sad.mean()


def test_what_cannot_be_is_relaxed_and_said():
    chooser = selector()
    chooser.set_controls([Constraint("wrist_height", "both", "at_least", 3.0, "value")])
    assert any("relaxed to percentile" in said for said in chooser.relaxed)
    assert 0 < chooser.eligible < 0.1
    show = Show(chooser).run(8.0, SPEECH, START + 30)
    assert "speech" in show.sources
    chooser.set_controls([])
    assert chooser.relaxed == ()


def test_a_late_plan_skips_ahead_from_the_last_pose():
    show = Show(selector()).run(2.0)
    end, pose = max(show.seen), show.keypoints[-1]
    show.now += 5.0
    (window, *_) = show.chooser.plan(show.now)
    assert window.start == first_frame_after(show.now + 0.4) > end + 1
    assert np.abs(window.keypoints[0] - pose).max() < 0.01
    assert show.chooser.late == 1


@pytest.mark.parametrize(
    "options", [{}, {"k": 8, "seed": 3}, {"preselection": "audio"}, {"preselection": "pose_only"}]
)
def test_the_same_input_gives_the_same_motion(options):
    assert np.array_equal(talk(**options).keypoints, talk(**options).keypoints)


def test_another_seed_gives_another_motion_where_k_leaves_a_choice():
    assert not np.array_equal(talk(k=8, seed=1).keypoints, talk(k=8, seed=2).keypoints)
    assert np.array_equal(talk(k=1, seed=1).keypoints, talk(k=1, seed=2).keypoints)


def test_bad_input_is_named_and_changes_nothing():
    chooser = selector()
    with pytest.raises(InvalidValueError, match="'cheerful'; valid: .*sad"):
        chooser.set_emotion("cheerful")
    assert chooser.emotion == "neutral"
    with pytest.raises(InvalidValueError, match="'juggle'; valid: .*hello"):
        chooser.add_keyword("juggle", frame_time(START))
    with pytest.raises(InvalidValueError, match="nan"):
        chooser.add_keyword("hello", float("nan"))
    with pytest.raises(InvalidValueError, match="28 finite numbers"):
        chooser.add_features(START, np.full(28, np.nan))
    with pytest.raises(InvalidValueError, match="28 finite numbers"):
        chooser.add_features(START, SILENCE_FEATURES[:14])
    with pytest.raises(InvalidValueError, match="1 to 15"):
        selector(k=0)
    with pytest.raises(InvalidValueError, match="pose, audio, pose_only"):
        selector(preselection="both")
