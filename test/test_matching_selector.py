"""The selector: windows that never stop, speech and silence, emotion and controls."""

import dataclasses

import numpy as np
import pytest
from show import DATABASE, EMOTIONS, GESTURES, SPEECH, START, WRISTS, Show, selector

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.frames import FRAME_RATE, WINDOW, first_frame_after, frame_time
from gesture_bot.base.keypoints import bone_lengths
from gesture_bot.corpus.recordings import Recording, build_database
from gesture_bot.matching.controls import Constraint, Controls, LabelConstraint
from gesture_bot.matching.hearing import ONSET, SHORTEST
from gesture_bot.matching.selector import AHEAD, REACT, SOON, Selector
from gesture_bot.matching.settling import BREATH, rest_pose, rest_poses
from gesture_bot.speech.activity import ActivityStream
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.features import SILENCE_FEATURES, FeatureStream
from gesture_bot.speech.voice import load_voice

UNLABELLED = dataclasses.replace(
    DATABASE, labels=np.full_like(DATABASE.labels, -1), names=dict.fromkeys(DATABASE.names, ())
)


def talk(emotion="neutral", controls=(), seconds=13.0, **options):
    chooser = selector(**options)
    chooser.set_emotion(emotion)
    chooser.set_controls(controls)
    return Show(chooser).run(seconds, SPEECH, START + 30)


def test_there_is_always_a_plan_up_to_the_horizon():
    show = Show(selector())
    for _ in range(100):
        show.tick()
        assert frame_time(max(show.seen)) >= show.now + SOON - 1e-6
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
    assert START + 120 - SHORTEST <= first + spoken[-1] < START + 120
    assert set(sources[spoken[0] : spoken[-1]]) == {"speech"}
    for window in show.windows:
        if window.source == "speech":
            row = DATABASE.starts[window.sequence] + window.frame
            assert np.array_equal(window.keypoints, DATABASE.keypoints[row : row + len(window.keypoints)])
            assert window.candidates >= 1 and window.pose_distance > 0
    assert np.linalg.norm(rest_poses(DATABASE) - show.keypoints[-1], axis=-1).max(axis=1).min() < 0.02


@pytest.mark.parametrize("lead", [2.0, 1.7])
def test_when_nobody_speaks_the_arms_soon_come_to_rest_close_by(lead):
    poses, breath = rest_poses(DATABASE), round(BREATH * FRAME_RATE)
    chosen = set()
    for frames in range(60, 100, 5):
        speech = [*SPEECH[:frames], *[SILENCE_FEATURES] * 40]
        show = Show(selector()).run(20.0, speech, START + 30, lead)
        end = START + 30 + frames - 1

        def left(frame, show=show):
            """How far the wrists are from where they are two breaths later [m]."""
            return np.linalg.norm((show.seen[frame][0] - show.seen[frame + 2 * breath][0])[WRISTS])

        starts = [window.start for window in show.windows if window.start > end - 8]
        assert starts == sorted(set(starts)), "nothing is planned twice"
        assert left(end) > 0.03
        # It takes the detector up to 0.2 s to notice the end: 1.5 s in all.
        assert left(end + 19) < 0.05 * left(end)
        begin = min(
            frame for frame, (_, window) in show.seen.items() if frame > end - 8 and window.source == "rest"
        )
        distances = [
            np.linalg.norm(poses - show.seen[frame][0], axis=-1).mean(axis=1)
            for frame in (begin - 1, begin + 90)
        ]
        assert distances[0].argmin() == distances[1].argmin()
        assert distances[1].min() < 0.01
        chosen.add(distances[1].argmin())
    assert len(chosen) > 1


def test_a_microphone_wakes_the_arms_within_a_step():
    """Sound that is analysed after it was heard, in a noisy room; the selector rests before."""
    utterance = load_voice("embedded").speak("Let us begin with the second one.")
    sentence = utterance.samples
    heard = np.concatenate([np.zeros(3 * SAMPLE_RATE), sentence, np.zeros(3 * SAMPLE_RATE)])
    noise = np.random.default_rng(3).normal(size=len(heard)) * np.sqrt(np.mean(sentence**2)) / 6
    features, activity = FeatureStream(), ActivityStream()
    show, arrived, spoken, learned = Show(selector()), START, [], 0.0
    for piece in np.array_split((heard + noise).astype(np.float32), len(heard) // 533):
        spoken += list(activity.push(piece))
        for frame in features.push(piece):
            show.chooser.hearing.add_features(arrived, frame, spoken[arrived - START], "microphone")
            learned = learned or spoken[arrived - START] * show.now
            arrived += 1
        show.tick()
        show.now += len(piece) / SAMPLE_RATE
    sources = {frame: window.source for frame, (_, window) in sorted(show.seen.items())}
    moving = [frame for frame, source in sources.items() if source == "speech"]
    begin, end = (
        frame_time(START) + 3 + moment for moment in (utterance.words[0].start, utterance.words[-1].end)
    )
    assert 0 < learned - begin < 0.3
    assert learned < frame_time(moving[0]) <= learned + 8 / FRAME_RATE
    assert moving == list(range(moving[0], moving[-1] + 1))
    assert end < frame_time(moving[-1]) < end + 1.5


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
    assert begin == pytest.approx(max(heard + (REACT - lead) * FRAME_RATE, heard - ONSET), abs=2)


def test_announced_speech_is_planned_long_before_it_is_seen():
    show = Show(selector()).run(6.0, SPEECH, START + 30)
    assert frame_time(max(show.seen)) >= show.now - 1 / 30 + AHEAD - 1e-6


def test_of_two_live_speakers_the_silent_one_does_not_count():
    show = Show(selector())
    for frame in range(START + 20, START + 60):
        show.hear(frame, SPEECH[frame - START], live=True, speaker="somebody")
        show.hear(frame, SILENCE_FEATURES, live=True, speaker="microphone")
    assert show.chooser.hearing.spoken(START + 30, 8) == 8


@pytest.mark.parametrize("look_ahead", [0.25, 0.8, 1.1])
def test_live_speech_moves_the_arms_a_look_ahead_later(look_ahead):
    """Each frame is known 0.13 s after it began, as from a microphone."""
    show = Show(selector())
    late = round(look_ahead * FRAME_RATE)
    heard = START + 60
    while show.now < frame_time(heard) + 5.0:
        known = int((show.now - 0.13) * FRAME_RATE)
        show.hear(known + late, SPEECH[known - heard] if known >= heard else SILENCE_FEATURES, live=True)
        show.tick()
        show.now += 1 / 30
    begin = min(frame for frame, shown in show.seen.items() if shown[1].source == "speech")
    assert heard + late - ONSET - WINDOW <= begin <= heard + max(late, (0.13 + REACT) * FRAME_RATE) + 1
    assert show.sources[-30:] == ["speech"] * 30
    assert show.chooser.late == 0


def test_what_is_announced_goes_before_what_is_heard_live():
    announced, both = Show(selector()), Show(selector())
    announced.run(6.0, SPEECH[:60], START + 40)
    for step in range(180):
        if step == 1:
            for number, features in enumerate(SPEECH[:60]):
                both.hear(START + 40 + number, features)
        live = int(both.now * FRAME_RATE) + 10
        both.hear(live, SPEECH[100 + step // 2] if live > START + 38 else SILENCE_FEATURES, live=True)
        both.tick()
        both.now += 1 / 30
    chosen = [
        [(w.start, w.sequence, w.frame) for w in show.windows if START + 36 < w.start < START + 80]
        for show in (announced, both)
    ]
    assert chosen[0] == chosen[1] != []


def test_a_control_raises_the_wrist():
    constraint = Constraint("wrist_height", "at_least", 85, "left")
    free, controlled = (
        talk(controls=controls).wrists("speech")[0][:, 0, 2] for controls in ((), (constraint,))
    )
    assert controlled.mean() > free.mean()
    assert controlled.mean() > 0.95 * Controls(DATABASE).threshold(constraint)


def test_an_emotion_shows_in_the_motion():
    angry, sad = (talk(emotion, seconds=8.0).wrists("speech")[1].mean() for emotion in ("angry", "sad"))
    assert angry > 1.5 * sad


def of_mood(mood):
    return DATABASE.labelled("emotion", mood)[:, None].repeat(64, axis=1)


def test_emotion_and_control_act_in_the_next_window_planned():
    show = Show(selector()).run(4.0, SPEECH, START + 30, lead=60)
    high = Constraint("wrist_height", "at_least", 80, "left")
    for change, mask in (
        (lambda: show.chooser.set_emotion("sad"), of_mood("sad")),
        (lambda: show.chooser.set_emotion("angry"), of_mood("angry")),
        (lambda: show.chooser.set_controls([high]), Controls(DATABASE).mask(high)),
    ):
        change()
        changed, planned = show.now, len(show.windows)
        show.run(3.0)
        windows = show.windows[planned:]
        assert windows[0].start <= first_frame_after(changed + 0.8) + 8
        for window in windows:
            assert window.source == "speech"
            assert mask[window.sequence, window.frame] and mask[window.sequence, window.frame + 7]


def again(show):
    """How often a window begins where one of the 25 s before it began, give or take 4 frames."""
    windows = spoken(show)
    return sum(
        any(w.sequence == b.sequence and abs(w.frame - b.frame) <= 4 for b in windows[max(0, i - 46) : i])
        for i, w in enumerate(windows)
    )


@pytest.mark.parametrize("options", [{}, {"k": 5}, {"preselection": "audio"}])
def test_windows_do_not_come_again_while_others_are_left(options):
    chooser = Selector(UNLABELLED, GESTURES, EMOTIONS, **options)
    chooser.set_controls([Constraint("wrist_height", "at_least", 60, "left")])
    admission = Controls(UNLABELLED).admit(chooser.constraints)
    show = Show(chooser).run(30.0, np.tile(SPEECH, (3, 1)), START + 30)
    assert len(spoken(show)) > 50
    assert again(show) == 0
    assert all(admission.mask[window.sequence, window.frame] for window in spoken(show))


def test_windows_come_again_where_few_are_left():
    chooser = selector()
    chooser.set_controls([Constraint("wrist_height", "at_least", 99, "left")])
    assert again(Show(chooser).run(30.0, np.tile(SPEECH, (3, 1)), START + 30)) > 0


def test_a_control_with_a_duration_ends_by_itself():
    show = Show(selector()).run(4.0, SPEECH, START + 30, lead=60)
    asked = show.now - 1.0
    short = Constraint("wrist_height", "at_least", 90, "left", duration=3.0)
    long = LabelConstraint("emotion", ("angry",), duration=6.0)
    ever = Constraint("wrist_speed", "at_most", 90)
    show.chooser.set_controls([short, long, ever], asked)
    for until, left in ((2.9, (short, long, ever)), (5.9, (long, ever)), (7.0, (ever,))):
        show.run(asked + until - show.now)
        assert show.chooser.constraints == left
        alone = selector()
        alone.set_controls(left, asked)
        assert show.chooser.eligible == alone.eligible


@pytest.mark.parametrize("sequences", [1, 2, 6])
def test_a_small_database_goes_on_moving_under_any_control(sequences):
    keypoints, features = DATABASE.keypoints[:64], DATABASE.features[:64]
    database = build_database([Recording("", keypoints, features)] * sequences, {})
    chooser = Selector(database, GESTURES, EMOTIONS)
    chooser.set_controls([Constraint("wrist_height", "at_least", 9.0, unit="value")])
    show = Show(chooser).run(13.0, SPEECH, START + 30)
    windows = [window for window in show.windows if START + 45 < window.start < START + 200]
    assert {window.source for window in windows} == {"speech"}
    assert show.wrists("speech")[1].mean() > 0.05


def shaped(tempo, amplitude, controls=(), database=UNLABELLED, seconds=13.0):
    """A show of speech with an emotion that does nothing but this."""
    emotion = dataclasses.replace(EMOTIONS["sad"], constraints=(), tempo=tempo, amplitude=amplitude)
    chooser = Selector(database, GESTURES, {**EMOTIONS, "sad": emotion})
    chooser.set_emotion("sad")
    chooser.set_controls(controls)
    return Show(chooser).run(seconds, np.tile(SPEECH, (3, 1)), START + 30, lead=60)


def spoken(show):
    return [window for window in show.windows if window.source == "speech"]


def speed(show):
    """Mean speed of the wrists within windows of speech [m/s]."""
    steps = [np.diff(window.keypoints[:, WRISTS], axis=0) for window in spoken(show)]
    return np.linalg.norm(np.concatenate(steps), axis=-1).mean() * FRAME_RATE


@pytest.mark.parametrize("tempo", [0.5, 1.3, 2.0])
def test_tempo_shows_more_or_fewer_frames_of_the_recording(tempo):
    show = shaped(tempo, 1.0, seconds=39.0)
    for window in spoken(show):
        first = DATABASE.starts[window.sequence] + window.frame
        rows = first + tempo * np.arange(len(window.keypoints))
        around = DATABASE.keypoints[[np.floor(rows).astype(int), np.ceil(rows).astype(int)]].astype(float)
        assert (
            np.abs(window.keypoints - around.mean(axis=0)).max() < 0.01 + np.abs(around[0] - around[1]).max()
        )
        assert np.allclose(bone_lengths(window.keypoints), bone_lengths(around[0]), atol=1e-6)
    assert speed(show) == pytest.approx(tempo * speed(shaped(1.0, 1.0, seconds=39.0)), rel=0.25)


@pytest.mark.parametrize("amplitude", [0.4, 1.3])
def test_amplitude_takes_the_hands_further_from_rest_or_nearer(amplitude):
    rest = rest_pose(UNLABELLED)[WRISTS]
    show = shaped(1.0, amplitude)
    ratios = []
    for window in spoken(show)[1:]:
        row = DATABASE.starts[window.sequence] + window.frame
        recorded = DATABASE.keypoints[row : row + len(window.keypoints)]
        assert np.allclose(bone_lengths(window.keypoints), bone_lengths(recorded), atol=1e-6)
        assert np.array_equal(window.keypoints[:, :8], recorded[:, :8])
        ratios.append(
            np.linalg.norm(window.keypoints[:, WRISTS] - rest, axis=-1).mean()
            / np.linalg.norm(recorded[:, WRISTS] - rest, axis=-1).mean()
        )
    assert np.mean(ratios) == pytest.approx(amplitude, rel=0.15)


def test_a_change_of_amplitude_makes_no_jump():
    show = shaped(1.0, 0.4, seconds=7.0)
    planned = len(show.windows)
    show.chooser.set_emotion("neutral")
    show.run(2.0)
    before, after = show.windows[planned - 1 : planned + 1]
    recorded_before, recorded_after = (
        DATABASE.keypoints[DATABASE.starts[window.sequence] + window.frame + frame]
        for window, frame in ((before, 7), (after, 0))
    )
    jump, recorded = after.keypoints[0] - before.keypoints[-1], recorded_after - recorded_before
    assert np.abs(after.keypoints - UNLABELLED.keypoints[0]).max() > 0.1
    assert np.linalg.norm(jump, axis=-1).max() < np.linalg.norm(recorded, axis=-1).max() + 0.03


def test_motion_is_shown_as_recorded_where_it_has_the_emotion_or_a_control_bounds_it():
    height, speed = (
        Constraint("wrist_height", "at_least", 60, "left"),
        Constraint("wrist_speed", "at_most", 60),
    )
    for controls, database, shape in (
        ((), UNLABELLED, (1.5, 0.5)),
        ((), DATABASE, (1.0, 1.0)),
        ((height,), UNLABELLED, (1.5, 1.0)),
        ((speed,), UNLABELLED, (1.0, 1.0)),
    ):
        windows = spoken(shaped(1.5, 0.5, controls, database))
        assert {(window.shown[1], window.amplitude) for window in windows} == {shape}


def test_what_cannot_be_is_relaxed_and_said():
    chooser = selector()
    chooser.set_controls([Constraint("wrist_height", "at_least", 3.0, "both", "value")])
    assert any("relaxed to " in said for said in chooser.relaxed)
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
    assert window.start == first_frame_after(show.now + REACT) > end + 1
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
    chooser.set_controls([Constraint("wrist_height", "at_least", 80)])
    with pytest.raises(InvalidValueError, match="'glad'; valid: neutral, sad, angry"):
        chooser.set_controls([LabelConstraint("emotion", ("glad",))])
    assert chooser.constraints == (Constraint("wrist_height", "at_least", 80),)
    with pytest.raises(InvalidValueError, match="28 finite numbers"):
        chooser.hearing.add_features(START, np.full(28, np.nan), speech=True)
    with pytest.raises(InvalidValueError, match="28 finite numbers"):
        chooser.hearing.add_features(START, SILENCE_FEATURES[:14], speech=False)
    with pytest.raises(InvalidValueError, match="1 to 15"):
        selector(k=0)
    with pytest.raises(InvalidValueError, match="pose, audio, pose_only"):
        selector(preselection="both")


def test_a_cut_ends_speech_and_its_gestures_at_once_and_for_good():
    show = Show(selector()).run(4.0, SPEECH, START + 15)  # announced two seconds ahead
    show.chooser.add_keyword("hello", show.now + 1.0)
    show.run(0.5)
    assert {"speech", "bank"} <= set(show.sources)
    moment = show.now
    show.chooser.cut(moment)
    show.run(3.0)
    after = {window.source for frame, (_, window) in show.seen.items() if frame_time(frame) > moment + 0.2}
    assert after == {"rest"}
    speed = np.linalg.norm(np.diff(show.keypoints, axis=0), axis=-1) * FRAME_RATE
    assert speed[-10:].max() < 0.05


def test_a_cut_gesture_may_be_made_at_once_for_the_next_sentence():
    show = Show(selector()).run(1.0)
    show.chooser.add_keyword("hello", show.now + 1.5)
    show.run(0.9)
    assert "bank" in show.sources, "it prepares"
    show.chooser.cut(show.now)
    show.chooser.add_keyword("hello", show.now + 1.2)
    show.run(2.0)
    strokes = {window.stroke for _, window in show.seen.values() if window.source == "bank"}
    assert max(strokes) == pytest.approx(show.now - 0.8, abs=0.1)


def test_a_cut_that_is_to_come_lets_the_gesture_before_it_be_finished():
    def bank_frames(cut):
        show = Show(selector()).run(1.0, SPEECH, START + 15)
        show.chooser.add_keyword("hello", show.now + 1.0)
        show.run(0.4)
        if cut:
            show.chooser.cut(show.now + 1.2)
        show.run(2.5)
        return [frame for frame, (_, window) in sorted(show.seen.items()) if window.source == "bank"]

    whole, cut = bank_frames(False), bank_frames(True)
    assert cut == [frame for frame in whole if frame <= cut[-1]]
    assert cut[-1] >= whole[0] + 12


def test_after_a_cut_the_next_sentence_has_its_gestures():
    show = Show(selector()).run(4.0, SPEECH, START + 15)
    show.chooser.cut(show.now)
    show.run(0.3)
    before = len(show.sources)
    show.run(1.0, SPEECH[40:80], round(show.now * FRAME_RATE) + 12)
    show.chooser.add_keyword("hello", show.now + 1.0)
    show.run(2.5)
    assert {"speech", "bank"} <= set(show.sources[before:])
