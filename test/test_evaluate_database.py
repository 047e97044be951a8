"""`gesture-bot inspect`: what it prints and draws of a database, and of files that are none."""

import json
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from safetensors import safe_open
from safetensors.numpy import load_file, save_file
from small_database import small_database

from gesture_bot.cli.main import main
from gesture_bot.corpus.database import FORMAT
from gesture_bot.evaluate.database_picture import spread_out
from gesture_bot.evaluate.database_report import database_report


@pytest.fixture(scope="module")
def database():
    metadata = {
        "provenance": "made for a test",
        "licence": "CC0-1.0",
        "settings": {"future": "real"},
        "sources": [
            {
                "name": "a.bvh",
                "skeleton": "beat",
                "frames": {"read": 900, "kept": 700, "mended": 3, "lost": 200},
            },
            {
                "name": "b.bvh",
                "skeleton": "trinity",
                "frames": {"read": 500, "kept": 480, "mended": 0, "short": 20},
            },
        ],
    }
    return replace(small_database(), metadata=metadata)


@pytest.fixture
def path(database, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    database.save(tmp_path / "mine.safetensors")
    return tmp_path / "mine.safetensors"


def test_all_that_a_database_says_of_itself_is_printed(path, capsys):
    assert main(["inspect", str(path)]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    with safe_open(path, "numpy") as opened:
        checksum = json.loads(opened.metadata()[FORMAT])["checksum"]
    for said in (
        "version 2", checksum, "17 keypoints, 15 frames a second", "2.7 minutes", "recordings 12",
        "sequences 48", "emotion neutral 20, sad 16, angry 12", "speaker not labelled 48",
        "made for a test", "CC0-1.0", "2 files, read with beat, trinity",
        "read 1400, kept 1180, mended 3", "cut lost 200, short 20",
        "left wrist speed [cm/s]", "right hand radius [cm]", "wrote mine.png",
    ):  # fmt: skip
        assert said in printed


def test_the_printed_quantiles_are_those_of_the_motion(database, path, capsys):
    main(["inspect", str(path)])
    (line,) = [line for line in capsys.readouterr().out.splitlines() if line.startswith("left wrist height")]
    heights = 100 * database_report(database).quantities["wrist_height"][0]
    assert [float(number) for number in line.split()[-5:]] == pytest.approx(
        np.percentile(heights, (1, 15, 50, 85, 99)), abs=0.051
    )


def test_frames_that_two_sequences_share_count_once(database):
    report = database_report(database)
    # 12 recordings of 200 frames are cut into 4 sequences each, of which the last two overlap.
    assert report.sequences == 48
    assert report.hours == pytest.approx(12 * 200 / 15 / 3600)


def test_the_picture_shows_both_hands_and_the_poses(path, tmp_path):
    assert main(["inspect", str(path), "-o", str(tmp_path / "deep/picture.png")]) == 0
    with Image.open(tmp_path / "deep/picture.png") as picture:
        pixels = np.asarray(picture.convert("RGB"), int)
    blue = (np.abs(pixels - (0x1F, 0x6F, 0xB2)) < 12).all(axis=2)
    red = (np.abs(pixels - (0xD1, 0x49, 0x5B)) < 12).all(axis=2)
    lower = slice(2 * len(pixels) // 5, None)
    for hand in (blue, red):
        assert hand[: lower.start].sum() > 300
        assert hand[lower].sum() > 2000
    # Figures face the reader: their right hands are on the left.
    reds, blues = (np.flatnonzero(hand[lower].any(axis=0)) for hand in (red, blue))
    assert reds[0] < blues[0]
    assert reds[-1] < blues[-1]


def test_only_png_is_drawn(path, capsys):
    assert main(["inspect", str(path), "-o", "picture.doc"]) == 1
    assert "picture.doc" in capsys.readouterr().err


def test_a_picture_that_cannot_be_written_is_an_error_in_one_line(path, tmp_path, capsys):
    (tmp_path / "file").touch()
    assert main(["inspect", str(path), "-o", str(tmp_path / "file/picture.png")]) == 1
    assert "cannot write" in capsys.readouterr().err


def test_poses_are_chosen_from_all_over():
    clouds = np.random.default_rng(0).normal(size=(400, 3)) * 0.01
    clouds[:100] += 5
    clouds[100:110] -= 5
    chosen, shares = spread_out(clouds, 3)
    assert sorted(np.searchsorted([100, 110], chosen, "right").tolist()) == [0, 1, 2]
    assert sorted(shares) == pytest.approx([10 / 400, 100 / 400, 290 / 400])
    assert len(spread_out(np.ones((50, 3)), 8)[0]) == 1


def _older(path):
    with safe_open(path, "numpy") as opened:
        header = json.loads(opened.metadata()[FORMAT])
    save_file(load_file(path), path, {FORMAT: json.dumps({**header, "version": 1})})


def _another_skeleton(path):
    with safe_open(path, "numpy") as opened:
        header = json.loads(opened.metadata()[FORMAT])
    header["skeleton"] = header["skeleton"][:-1]
    save_file(load_file(path), path, {FORMAT: json.dumps(header)})


def _truncated(path):
    path.write_bytes(path.read_bytes()[:-1000])


@pytest.mark.parametrize(
    ("change", "message"),
    [(_older, "version"), (_another_skeleton, "skeleton"), (_truncated, "cannot read")],
)
def test_a_file_that_cannot_be_used_is_an_error_in_one_line(path, capsys, change, message):
    change(path)
    assert main(["inspect", str(path)]) == 1
    error = capsys.readouterr().err
    assert message in error
    assert str(path) in error
    assert error.count("\n") == 1
    assert not path.with_suffix(".png").exists()
