"""Motion on the beat of speech: which frames are shown, and what the selector makes of it."""

import numpy as np
import pytest
from show import DATABASE, SPEECH, START, WRISTS, Show, selector

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.frames import FRAME_RATE, WINDOW, frame_time
from gesture_bot.corpus.database import LOOKAHEAD, SEQUENCE
from gesture_bot.corpus.movement import minimum_jerk
from gesture_bot.matching.controls import Constraint
from gesture_bot.matching.rhythm import STRETCH, aligned, motion_beats
from gesture_bot.matching.shaping import TEMPO

BEATS = START + 30 + np.arange(0, 600, 5.4)
"""Beats of the speech [frames]."""


def test_a_stroke_has_its_beat_where_it_brakes_hardest():
    """A minimum-jerk movement brakes hardest at 0.789 of its time, where its jerk is zero."""
    for begin in (6.0, 6.3, 6.5, 6.8):
        keypoints = np.zeros((30, 17, 3))
        keypoints[:, WRISTS, 2] = 0.4 * minimum_jerk((np.arange(30) - begin) / 10)[:, None]
        np.testing.assert_allclose(motion_beats(keypoints), [begin + 10 * (0.5 + np.sqrt(3) / 6)], atol=0.1)


def test_stillness_and_short_clips_have_no_beats():
    tremor = 1e-3 * np.random.default_rng(0).standard_normal((40, 17, 3))
    assert len(motion_beats(tremor)) == len(motion_beats(np.zeros((4, 17, 3)))) == 0


@pytest.mark.parametrize("tempo", [0.6, 1.0, 1.6])
@pytest.mark.parametrize(("move", "beat"), [(4.0, 4.8), (6.0, 5.1), (2.0, 2.4), (7.0, 6.0)])
def test_a_beat_is_moved_onto_that_of_the_speech(move, beat, tempo):
    shown = aligned(np.array([tempo * move]), np.array([beat]), 8, tempo)
    there = np.interp(tempo * move, shown, np.arange(8))
    assert abs(there - beat) < 0.35 * abs(move - beat)


def test_of_two_beats_both_come_nearer():
    moves = np.array([3.0, 6.5])
    for beats in ([2.6, 6.9], [2.6, 5.8], [3.5, 7.2]):
        there = np.interp(moves, aligned(moves, np.array(beats), 8, 1.0), np.arange(8))
        assert (np.abs(there - beats) < 0.75 * np.abs(moves - beats)).all()


def test_nothing_near_is_played_as_recorded():
    plain = np.arange(8)
    for moves, beats in (([], [3.0]), ([3.0], []), ([1.0], [7.0]), ([4.0], [4.0]), ([3.0], [-1.0, 8.0])):
        np.testing.assert_array_equal(aligned(np.array(moves), np.array(beats), 8, 1.0), plain)


def test_the_rate_stays_within_the_stretch_and_changes_evenly():
    generator = np.random.default_rng(4)
    for frames in (1, 2, 5, 8):
        for _ in range(200):
            tempo = generator.uniform(0.5, 2)
            moves, beats = (generator.uniform(-2, 10, 3) for _ in range(2))
            shown = aligned(tempo * moves, beats, frames, tempo)
            rates = np.diff(shown) / tempo
            assert shown[0] == 0 and len(shown) == frames
            assert (np.abs(rates - 1) < STRETCH + 1e-9).all()
            assert np.allclose(np.diff(rates, n=2), 0)


def test_the_fastest_window_ends_within_the_real_future():
    last = SEQUENCE - WINDOW + (1 + STRETCH) * TEMPO[1] * (WINDOW - 1)
    assert np.ceil(last) < SEQUENCE + LOOKAHEAD


def shown_with_beats(controls=(), **options):
    chooser = selector(**options)
    chooser.set_emotion("angry")
    chooser.set_controls(controls)
    for beat in BEATS:
        chooser.hearing.add_beat(frame_time(beat))
    return Show(chooser).run(39.0, np.tile(SPEECH, (3, 1)), START + 30)


def distances(window):
    """How far the recorded beats of a window are from those of the speech [frames]: as recorded, as shown."""
    row = DATABASE.starts[window.sequence] + window.frame
    moves = motion_beats(DATABASE.keypoints[row : row + 14])
    moves = moves[moves <= window.shown[-1]]
    shown = np.interp(moves, window.shown, np.arange(len(window.shown)))
    return [np.abs(there[:, None] + window.start - BEATS).min(axis=1) for there in (moves, shown)]


def test_the_selector_moves_beats_and_goes_on_from_what_it_has_shown():
    show = shown_with_beats(align_beats=True)
    windows = [window for window in show.windows if window.source == "speech"]
    recorded, shown = np.concatenate([distances(window) for window in windows], axis=1)
    near = recorded < 1.5
    assert near.sum() > 8
    assert shown[near].mean() < 0.6 * recorded[near].mean()
    warped = 0
    for window in windows:
        rows = DATABASE.starts[window.sequence] + window.frame + window.shown
        warped += (rows % 1 != 0).any()
        before = np.floor(rows).astype(int)
        moved = np.linalg.norm(window.keypoints - DATABASE.keypoints[before], axis=-1).max()
        step = np.linalg.norm(DATABASE.keypoints[before + 1] - DATABASE.keypoints[before], axis=-1).max()
        assert moved <= step + 0.005
        around = DATABASE.keypoints[before[0] : before[-1] + 2, WRISTS]
        speeds = [
            np.linalg.norm(np.diff(wrists, axis=0), axis=-1).max() * FRAME_RATE
            for wrists in (window.keypoints[:, WRISTS], around)
        ]
        assert speeds[0] <= (1 + STRETCH) * speeds[1] + 0.01
    assert warped > len(windows) / 2


def test_without_alignment_or_under_a_bound_on_speed_motion_is_as_recorded():
    slow = Constraint("wrist_speed", "at_most", 60)
    for show in (shown_with_beats(align_beats=False), shown_with_beats([slow], align_beats=True)):
        for window in show.windows:
            if window.source == "speech":
                assert np.array_equal(window.shown, np.arange(len(window.keypoints)))


def test_beats_after_a_cut_are_forgotten():
    """The speech that follows the cut is played as if the beats had never been told."""
    shows = []
    for beats in (BEATS[BEATS < START + 60], BEATS):
        chooser = selector(align_beats=True)
        for beat in beats:
            chooser.hearing.add_beat(frame_time(beat))
        show = Show(chooser).run(2.0, SPEECH[:60], START + 30)
        chooser.cut(frame_time(START + 60))
        shows.append(show.run(8.0, SPEECH, START + 90))
    assert np.array_equal(shows[0].keypoints, shows[1].keypoints)


def test_a_beat_at_no_moment_is_refused():
    with pytest.raises(InvalidValueError, match="beat"):
        selector().hearing.add_beat(np.nan)
