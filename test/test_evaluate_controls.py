"""`gesture-bot evaluate controls`: what the table says is what the motion does."""

import csv
from dataclasses import replace

import numpy as np
import pytest
import soundfile
from small_database import small_database

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.cli.main import main
from gesture_bot.corpus.sentences import SENTENCES
from gesture_bot.evaluate.control_table import CONTROLS, Spread, control_table
from gesture_bot.evaluate.held_sentences import HELD_SENTENCES
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.features import SILENCE_FEATURES
from gesture_bot.speech.streaming import SpeechFrame
from gesture_bot.speech.voice import load_voice

SENTENCE = "The goats have found the gap in the fence again, all eleven of them, and the cook is not amused."


@pytest.fixture(scope="module")
def database():
    return small_database(recordings=24)


@pytest.fixture(scope="module")
def wav(tmp_path_factory):
    path = tmp_path_factory.mktemp("speech") / "speech.wav"
    soundfile.write(path, load_voice("embedded").speak(SENTENCE).samples, SAMPLE_RATE)
    return path


@pytest.fixture(scope="module")
def rows(database):
    features = np.random.default_rng(5).normal(size=(300, 28)).astype(np.float32)
    features[:, 13] = -20.0
    speech = [SpeechFrame(frame, vector, True) for frame, vector in enumerate(features)]
    return {row.name: row for row in control_table(database, speech)}


def test_the_means_lie_on_their_sides(rows):
    for row in rows.values():
        # A bound holds at the ends of a window alone; that of `symmetric` is but 2 cm in this database.
        assert "mean" not in row.missed(row.found) or row.name == "symmetric", row
        assert not row.relaxed
        assert 0.02 < row.share < 0.25
    for high, low in (("high", "low"), ("fast", "slow"), ("asymmetric", "symmetric"), ("wide", "narrow")):
        assert rows[high].threshold > rows[low].threshold
        for stage in ("found", "refined"):
            more, less = getattr(rows[high], stage), getattr(rows[low], stage)
            assert more.controlled.mean > more.free.mean > less.controlled.mean
            assert more.free == less.free


def test_a_threshold_is_the_percentile_of_the_database(rows, database):
    frames = database.starts[:, None] + np.arange(64)
    heights = database.keypoints[frames, 9, 2]
    assert rows["high"].threshold == pytest.approx(np.percentile(heights, 85), abs=1e-6)
    assert rows["low"].threshold == pytest.approx(np.percentile(heights, 15), abs=1e-6)


def test_what_is_missed_is_told(rows):
    row = rows["high"]
    still = Spread(row.found.controlled.mean, 0.3 * row.found.free.deviation)
    assert row.missed(replace(row.found, controlled=still)) == ["variation"]
    assert rows["low"].missed(rows["high"].found)[:1] == ["mean"]


def test_silence_makes_no_table(database):
    with pytest.raises(InvalidValueError, match="no speech"):
        control_table(database, [SpeechFrame(frame, SILENCE_FEATURES, False) for frame in range(60)])


def test_motion_that_stands_still_is_nothing_to_measure(database, wav, tmp_path, capsys):
    still = np.repeat(database.keypoints[:1], len(database.keypoints), axis=0)
    replace(database, keypoints=still).save(tmp_path / "still.safetensors")
    arguments = [
        "evaluate",
        "controls",
        "--database",
        str(tmp_path / "still.safetensors"),
        "--speech",
        str(wav),
    ]
    assert main(arguments) == 1
    assert "no hand moves in the database" in capsys.readouterr().err
    assert np.isnan(Spread(0.1, 0.0).share_of(Spread(0.1, 0.0)))


def test_the_command_prints_and_writes_the_table(database, wav, tmp_path, capsys):
    database.save(tmp_path / "small.safetensors")
    output = tmp_path / "table.csv"
    arguments = ["evaluate", "controls", "--database", str(tmp_path / "small.safetensors")]
    assert main([*arguments, "--speech", str(wav), str(wav), "-o", str(output)]) == 0
    printed = capsys.readouterr().out
    lines = list(csv.DictReader(output.open()))
    assert [line["control"] for line in lines] == list(CONTROLS)
    for line in lines:
        row, _, asked = [text.split() for text in printed.splitlines() if text.startswith(line["control"])]
        assert row[1] == f"{100 * float(line['threshold']):.1f}"
        assert row[3] == f"{100 * float(line['found_mean']):.1f}"
        assert " ".join(asked[1:]) == line["constraint"]
        assert ("yes" in row) == (line["found_missed"] == "")
    assert "25.6 (3.4)" in printed


def test_a_missing_sound_file_is_an_error(capsys):
    assert main(["evaluate", "controls", "--speech", "nothing.wav"]) == 1
    assert "nothing.wav" in capsys.readouterr().err


def test_no_held_sentence_is_in_the_demo_corpus():
    assert len(set(HELD_SENTENCES)) == len(HELD_SENTENCES)
    assert not set(HELD_SENTENCES) & {sentence for said in SENTENCES.values() for sentence in said}
