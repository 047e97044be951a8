"""`gesture-bot build-database`: what comes out, what is said, and what an interruption leaves behind."""

import itertools
import os
import runpy
import shutil
import signal
import threading
import time
from pathlib import Path

import numpy as np
import pytest
import soundfile
from conftest import wait_until
from test_corpus_import import DATA, SPEECH, TRINITY, motion

from gesture_bot.base.keypoints import INDEX, KEYPOINTS
from gesture_bot.cli.main import main
from gesture_bot.corpus.body import Posture, pose
from gesture_bot.corpus.building import find_jobs
from gesture_bot.corpus.database import Database
from gesture_bot.corpus.importing import import_file
from gesture_bot.corpus.skeletons import load_skeletons
from gesture_bot.evaluate.motion_files import write_bvh
from gesture_bot.speech.audio import SAMPLE_RATE, load_audio
from gesture_bot.speech.features import speech_features


def record(path, seconds=6.0, seed=0):
    """A BVH file with sound beside it."""
    write_bvh(path, motion(15, seconds), 15)
    noise = 0.1 * np.random.default_rng(seed).normal(size=round(seconds * SAMPLE_RATE))
    soundfile.write(path.with_suffix(".wav"), noise, SAMPLE_RATE)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Three recordings, one of them without sound, in folders as data sets have them."""
    folder = tmp_path_factory.mktemp("data") / "set"
    for place, name in enumerate(("bvh/one", "bvh/two", "bvh/three")):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        record(folder / f"{name}.bvh", seed=place)
    (folder / "wav").mkdir()
    (folder / "bvh/one.wav").rename(folder / "wav/one.wav")
    (folder / "bvh/three.wav").unlink()
    (folder / "bvh/two.txt").write_text("a transcript")
    return folder


def build(*arguments):
    return main(["build-database", *map(str, arguments)])


def test_a_folder_becomes_a_database(folder, tmp_path, capsys):
    table = tmp_path / "labels.csv"
    table.write_text("file,emotion,speaker\none.bvh,happy,ann\nbvh/two,,bob\n")
    output = tmp_path / "own set.safetensors"
    arguments = (folder, "-o", output, "--labels", table, "--licence", "CC BY 4.0", "--workers")
    assert build(*arguments, 2) == 0
    said = capsys.readouterr()
    assert "three.bvh has no sound: looked for three.wav" in said.err
    assert "from 2 of 3 files" in said.out
    assert "speaker: ann, bob" in said.out
    assert "180 frames read, 0 mended, 180 kept; cut: none" in said.out
    assert f"gesture-bot run database:='{output}'" in said.out
    assert not output.with_name("own set.safetensors.parts").exists()

    database = Database.load(output)
    assert [database.label(sequence, "speaker") for sequence in range(4)] == ["ann", "ann", "bob", "bob"]
    assert [database.label(sequence, "emotion") for sequence in range(4)] == ["happy", "happy", "", ""]
    heard = speech_features(load_audio(folder / "wav/one.wav"))
    np.testing.assert_array_equal(database.features[: len(heard)], heard)
    assert database.metadata["licence"] == "CC BY 4.0"
    one, two = database.metadata["sources"]
    assert (one["name"], one["skeleton"], one["frames"]["kept"]) == ("set/bvh/one.bvh", "gesture_bot", 90)
    assert set(two["digests"]) == {"two.bvh", "two.wav"}
    assert str(folder) not in str(database.metadata)

    before = output.read_bytes()
    assert build(*arguments, 1) == 0
    assert output.read_bytes() == before


def test_an_interruption_is_quick_and_the_next_run_goes_on(tmp_path, capfd):
    (tmp_path / "data").mkdir()
    record(tmp_path / "data/0.bvh", 30.0)
    for number, ending in itertools.product(range(1, 6), (".bvh", ".wav")):
        shutil.copy(tmp_path / f"data/0{ending}", tmp_path / f"data/{number}{ending}")
    output, parts = tmp_path / "own.safetensors", tmp_path / "own.safetensors.parts"
    output.write_text("the old database")
    arguments = (tmp_path / "data", "-o", output, "--workers", 2)
    asked = []

    def interrupt():
        wait_until(lambda: list(parts.glob("*.npz")), 20, "the first file")
        asked.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGINT)

    threading.Thread(target=interrupt).start()
    assert build(*arguments) == 130
    assert time.monotonic() - asked[0] < 5
    said = capfd.readouterr().err
    assert "Traceback" not in said
    assert f"interrupted; {parts} keeps what is done" in said
    assert output.read_text() == "the old database"
    kept = {part: part.stat().st_mtime_ns for part in parts.glob("*.npz")}
    assert 0 < len(kept) < 6

    skeletons = list(load_skeletons().values())
    jobs = find_jobs([tmp_path / "data"], skeletons, parts)
    assert [import_file(job) for job in jobs] == [""] * 6
    assert all(part.stat().st_mtime_ns == moment for part, moment in kept.items())
    record(tmp_path / "data/5.bvh", 10.0)
    assert build(*arguments[:-1], 1) == 0
    assert "2400 frames read" in capfd.readouterr().out
    assert not parts.exists()
    whole = output.read_bytes()
    assert build(*arguments[:-1], 1) == 0
    assert output.read_bytes() == whole


def test_sound_that_is_missing_is_told(tmp_path, capsys):
    record(tmp_path / "whole.bvh", 8.0)
    record(tmp_path / "cut.bvh", 16.0, seed=1)
    record(tmp_path / "mute.bvh", 8.0)
    sound = load_audio(tmp_path / "cut.wav")
    soundfile.write(tmp_path / "cut.wav", sound[: 6 * SAMPLE_RATE], SAMPLE_RATE)
    soundfile.write(tmp_path / "mute.wav", np.zeros(8 * SAMPLE_RATE), SAMPLE_RATE)
    output = tmp_path / "own.safetensors"
    assert build(tmp_path, "-o", output, "--workers", 1) == 0
    out, err = capsys.readouterr()
    assert "from 2 of 3 files" in out
    assert "150 soundless" in out
    assert "mute.wav is silent from beginning to end" in err
    assert [line for line in err.splitlines() if line.startswith("note")] == [
        f"note: the sound of {tmp_path.name}/cut.bvh ends early: 150 of 240 frames"
    ]
    plain = tmp_path / "plain"
    plain.touch()
    assert output.stat().st_mode == plain.stat().st_mode, "other users read it, as other files"


def test_another_process_that_looks_at_the_command_does_not_run_it():
    """Processes that import files look at the script that started them: in a ROS workspace, this one."""
    runpy.run_path(str(Path(__file__).parents[1] / "cli/executable.in"), run_name="__mp_main__")


def test_a_file_is_imported_once_whatever_it_is_called(folder, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(folder)
    sources = ("bvh/two.bvh", folder / "bvh", "wav/../bvh", folder)
    assert build(*sources, "-o", tmp_path / "own.safetensors", "--workers", 1) == 0
    assert "from 2 of 3 files" in capsys.readouterr().out


def test_a_run_that_finds_nothing_leaves_what_an_earlier_one_imported(folder, tmp_path):
    output, parts = tmp_path / "own.safetensors", tmp_path / "own.safetensors.parts"
    parts.mkdir()
    (job, _, _) = find_jobs([folder], list(load_skeletons().values()), parts)
    assert import_file(job) == ""
    assert build(folder, "-o", output, "--map", "trinity", "--workers", 1) == 1
    assert job.part.exists()


def test_a_sound_that_was_added_is_heard(folder, tmp_path):
    shutil.copytree(folder, tmp_path / "set")
    skeletons = list(load_skeletons().values())
    before = find_jobs([tmp_path / "set"], skeletons, tmp_path)[0]
    shutil.copy(folder / "bvh/two.wav", tmp_path / "set/bvh/one.wav")
    after = find_jobs([tmp_path / "set"], skeletons, tmp_path)[0]
    assert before.path == after.path
    assert before.part != after.part


def test_a_name_that_is_no_text_does_not_stop_the_others(tmp_path, capfd):
    record(tmp_path / "x.bvh")
    for ending in (b".bvh", b".wav"):
        shutil.copy(os.fsencode(tmp_path) + b"/x" + ending, os.fsencode(tmp_path) + b"/\xff" + ending)
    assert build(tmp_path, "-o", tmp_path / "own.safetensors", "--workers", 1) == 0
    assert "of 2 files" in capfd.readouterr().out


@pytest.mark.parametrize("rate", [12, 30, 120])
def test_a_clap_is_seen_when_it_is_heard(tmp_path, rate):
    """A hand goes up and turns back sharply at each clap; in the middle, it cannot be seen for a while."""
    claps = 1.5 + 1.7321 * np.arange(20)
    times = np.arange(38 * rate) / rate
    raised = np.clip(1 - np.abs(times[:, None] - claps).min(axis=1) / 0.25, 0, 1)
    left = np.tile([0.3, 0.2, 0.1, 0.3, 0.1], (len(times), 1))
    still = np.zeros((len(times), 3))
    keypoints = pose(Posture(left + np.outer(raised, [0, 0, 0.25, 0, 0]), left, still, still, 0.2))
    keypoints[(times > 16) & (times < 18)] = np.nan
    samples = np.zeros(38 * 44_100)
    for clap in claps:
        samples[round(clap * 44_100) - 220 :][:440] = np.random.default_rng(0).uniform(-0.8, 0.8, 440)
    soundfile.write(tmp_path / "clap.wav", samples, 44_100)
    header = ",".join(f"{name}_{axis}" for name in KEYPOINTS for axis in "xyz")
    np.savetxt(tmp_path / "clap.csv", keypoints.reshape(-1, 51), "%.5f", ",", header=header, comments="")
    (tmp_path / "own.yaml").write_text(
        f"description: a test\naxes: [forward, left, up]\nrate: {rate}\njoints:\n"
        + "\n".join(f"  {name}: {name}" for name in KEYPOINTS)
    )
    output = tmp_path / "own.safetensors"
    assert build(tmp_path / "clap.csv", "-o", output, "--map", tmp_path / "own.yaml", "--workers", 1) == 0
    database = Database.load(output)
    height = database.keypoints[:, INDEX["left_wrist"], 2].astype(float)
    seen = height - height.min()
    heard = np.maximum(0, 10 ** (database.features[:, 13] / 10) - 2e-6)
    tops = [
        frame
        for frame in range(4, len(seen) - 4)
        if seen[frame] > 0.1 and seen[frame - 4 :][:9].argmax() == 4
    ]
    assert len(tops) >= 17
    for top in tops:
        around = np.arange(top - 4, top + 5)
        # A frame of keypoints is a moment; a frame of features lasts until the next one.
        late = np.average(around, weights=seen[around]) - np.average(around + 0.5, weights=heard[around])
        assert abs(late) < 0.5


def test_bad_files_are_named_and_left_out(folder, tmp_path, capsys):
    for name in ("good", "deaf", "torn"):
        record(tmp_path / f"{name}.bvh")
    soundfile.write(tmp_path / "deaf.wav", np.full(SAMPLE_RATE, np.nan), SAMPLE_RATE, subtype="FLOAT")
    (tmp_path / "torn.bvh").write_text("HIERARCHY")
    assert build(tmp_path, "-o", tmp_path / "own.safetensors", "--workers", 1) == 0
    errors = [line for line in capsys.readouterr().err.splitlines() if line.startswith("left out")]
    assert len(errors) == 2
    assert "deaf.wav holds samples that are not finite" in errors[0]
    assert "torn.bvh" in errors[1]
    assert len(Database.load(tmp_path / "own.safetensors").starts) == 2


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["nowhere"], "no file or folder: 'nowhere'"),
        (["{folder}/bvh/two.txt"], "two.txt'; valid: BVH"),
        (["{folder}/wav"], "wav'; valid: BVH"),
        (["{folder}", "--map", "bvh"], "unknown skeleton map: 'bvh'; valid: beat"),
        (["{folder}", "--map", "mine.yaml"], "cannot read mine.yaml"),
        (["{folder}", "--workers", "0"], "number of workers: 0"),
        (["{folder}", "--labels", "{table}"], "among the sources: 'four.bvh'"),
        (["{folder}", "--labels", "{folder}"], "cannot read"),
        (["{folder}", "--labels", "{short}"], "among the sources: ''"),
        (["{folder}", "--labels", "{long}"], "more cells than columns in the row of: 'one.bvh'"),
        (["{folder}", "--labels", "{columns}"], "'mood'; valid: file, emotion, style, speaker"),
        (["{folder}/bvh/three.bvh"], "no recording to build"),
        (["{folder}", "--map", "trinity"], "no recording to build"),
        (["{folder}", "-o", "{taken}"], "it is a folder"),
        (["{folder}", "-o", "own.onnx"], "kind of database file: 'own.onnx'; valid: .safetensors"),
        (["{folder}", "-o", "/proc/own.safetensors"], "cannot write /proc/own.safetensors"),
    ],
)
def test_wrong_input_is_named_in_one_line(folder, tmp_path, capsys, arguments, named):
    (tmp_path / "table.csv").write_text("file,emotion\nfour.bvh,happy\n")
    (tmp_path / "columns.csv").write_text("file,mood\none.bvh,happy\n")
    (tmp_path / "short.csv").write_text("emotion,file\nhappy\n")
    (tmp_path / "long.csv").write_text("file,emotion\none.bvh,happy,ann\n")
    tables = {name: tmp_path / f"{name}.csv" for name in ("table", "columns", "short", "long")}
    (taken := tmp_path / "taken.safetensors").mkdir()
    places = {"folder": folder, "taken": taken, **tables}
    output = ["-o", str(tmp_path / "own.safetensors")]
    assert build(*output, "--workers", 1, *(argument.format(**places) for argument in arguments)) == 1
    (error,) = [line for line in capsys.readouterr().err.splitlines() if line.startswith("gesture-bot: ")]
    assert named in error
    assert not list(tmp_path.glob("own.safetensors*"))


@pytest.mark.skipif(not DATA.exists(), reason="../shared/data is not there")
def test_real_recordings_become_a_database(tmp_path, capsys):
    """Two speakers on video, and motion capture that is given the sound of one of them."""
    (tmp_path / TRINITY.name).symlink_to(TRINITY)
    samples = np.concatenate([load_audio(sound) for sound in sorted(SPEECH.glob("*.wav"))] * 4)
    soundfile.write((tmp_path / TRINITY.name).with_suffix(".wav"), samples, SAMPLE_RATE)
    output = tmp_path / "own.safetensors"
    assert build(SPEECH, tmp_path, "-o", output, "--workers", 1) == 0
    assert "oliver_gt_interval_102571.txt has no sound" in capsys.readouterr().err
    database = Database.load(output)
    assert {source["skeleton"] for source in database.metadata["sources"]} == {
        "gestures_from_speech",
        "trinity",
    }
    assert len(database.starts) == 4 + 5 + 27
    assert np.isfinite(database.keypoints).all()
