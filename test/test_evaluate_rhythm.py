"""`gesture-bot evaluate rhythm`: PMB counts what it says, and the table shows what alignment does."""

import csv

import numpy as np
import pytest
import soundfile
from small_database import small_database

from gesture_bot.cli.main import main
from gesture_bot.corpus.movement import minimum_jerk
from gesture_bot.evaluate.rhythm import STAGES, THRESHOLDS, Speech, jerk, matched, rhythm_table
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.beats import speech_beats
from gesture_bot.speech.voice import load_voice

SENTENCE = "The goats have found the gap in the fence again, all eleven of them, and the cook is not amused."

WRISTS = [9, 14]


@pytest.fixture(scope="module")
def samples():
    return load_voice("embedded").speak(SENTENCE).samples


@pytest.fixture(scope="module")
def rows(samples):
    # A minimum-jerk stroke brakes hardest at 0.789 of its time.
    strokes = speech_beats(samples)[::3] - 0.4 * (0.5 + np.sqrt(3) / 6)
    times = np.arange(int(len(samples) / SAMPLE_RATE * 15)) / 15
    recorded = np.zeros((len(times), 17, 3))
    for number, begin in enumerate(strokes):
        recorded[:, WRISTS, 2] += (-1) ** number * 0.3 * minimum_jerk((times - begin) / 0.4)[:, None]
    speech = Speech(np.tile(samples, 3))
    return rhythm_table(small_database(recordings=12), [speech, Speech(samples, recorded)])


def test_beats_that_are_shifted_match_as_far_as_the_threshold_reaches():
    beats = np.arange(1.0, 11.0)
    moves = beats + np.repeat([0.05, 0.15, -0.25, 0.4], [4, 3, 2, 1])
    shares = [matched(moves, beats, within) for within in (0.04, 0.05, 0.15, 0.2, 0.25, 0.4)]
    assert shares == [0, 4, 7, 7, 9, 10]


def test_each_beat_of_the_speech_counts_once():
    assert matched(np.array([1.0, 1.1, 1.2]), np.array([1.1]), 0.2) == 1
    assert matched(np.array([1.0, 1.1]), np.array([0.9, 1.25]), 0.2) == 2
    # The first takes the earlier of its two, so that the second finds one, too.
    assert matched(np.array([1.0, 1.3]), np.array([0.95, 1.15]), 0.2) == 2
    assert matched(np.array([]), np.array([1.0]), 0.2) == matched(np.array([1.0]), np.array([]), 0.2) == 0


def test_jerk_of_a_cubic():
    time = np.arange(20) / 15
    keypoints = np.zeros((20, 17, 3))
    keypoints[:, WRISTS[0], 1] = 2 * time**3
    np.testing.assert_allclose(jerk(keypoints), 12 / 2, rtol=1e-6)


def test_the_rows_are_the_stages_with_and_without_alignment(rows):
    order = [(row.name, row.aligned) for row in rows]
    assert order == [(s, a) for s in STAGES[:2] for a in (False, True)] + [("recorded", False)]
    for row in rows:
        assert row.curve.shape == row.chance.shape == THRESHOLDS.shape
        assert (np.diff(row.curve) >= 0).all() and row.curve[-1] > 0.9
        assert row.rate > 0 and row.jerk > 0


def test_strokes_made_on_the_beat_are_found_there_and_not_by_chance(rows):
    pmb, chance = rows[-1].within(0.1)
    assert pmb > 0.9 > chance


def test_alignment_raises_the_share_of_beats(rows):
    for plain, aligned in (rows[:2], rows[2:4]):
        assert aligned.within(0.1)[0] > plain.within(0.1)[0] + 0.05
        assert abs(aligned.within(0.1)[1] - plain.within(0.1)[1]) < 0.1


def test_the_command_prints_and_writes(samples, tmp_path, capsys):
    small_database(recordings=12).save(tmp_path / "small.safetensors")
    soundfile.write(tmp_path / "speech.wav", samples, SAMPLE_RATE)
    arguments = ["evaluate", "rhythm", "--database", str(tmp_path / "small.safetensors")]
    arguments += ["--speech", str(tmp_path / "speech.wav"), "-o"]
    assert main([*arguments, str(tmp_path / "rhythm.csv")]) == 0
    printed = capsys.readouterr().out.splitlines()
    lines = list(csv.DictReader((tmp_path / "rhythm.csv").open()))
    assert [line["motion"] for line in lines] == ["found", "found", "refined", "refined"]
    for line in lines:
        row = ["yes" if line["aligned"] == "True" else "no"]
        row += [f"{float(line['beats_per_second']):.2f}", f"{float(line['pmb_0.10_s']):.1%}"]
        assert any(text.split()[:4] == [line["motion"], *row] for text in printed)
    assert main([*arguments, str(tmp_path / "rhythm.png")]) == 0
    assert (tmp_path / "rhythm.png").stat().st_size > 10_000
    assert main([*arguments, str(tmp_path / "rhythm.pdf")]) == 1
    assert ".png, .csv" in capsys.readouterr().err


def test_silence_is_an_error(tmp_path, capsys):
    soundfile.write(tmp_path / "silence.wav", np.zeros(SAMPLE_RATE * 2), SAMPLE_RATE)
    small_database(recordings=6).save(tmp_path / "small.safetensors")
    arguments = ["--database", str(tmp_path / "small.safetensors"), "--speech", str(tmp_path / "silence.wav")]
    assert main(["evaluate", "rhythm", *arguments]) == 1
    assert "no speech" in capsys.readouterr().err
