"""`gesture-bot robot`: from a URDF to a mapping that gestures, and what it says of a wrong one."""

import re
import shutil

import pytest
import yaml
from PIL import Image

from gesture_bot.base.files import config_dir
from gesture_bot.cli.main import main

URDF = config_dir() / "robots" / "toa.urdf"


@pytest.fixture
def urdf(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copy(URDF, tmp_path / "mine.urdf")
    return "mine.urdf"


def test_a_robot_is_added_corrected_and_checked(urdf, tmp_path, capsys):
    assert main(["robot", "add", urdf]) == 0
    with Image.open(tmp_path / "mine.png") as picture:
        assert max(picture.size) == 480
    assert main(["robot", "check", "mine.yaml", "-o", "again.png"]) == 0
    assert (tmp_path / "again.png").read_bytes() == (tmp_path / "mine.png").read_bytes()

    description = yaml.safe_load((tmp_path / "mine.yaml").read_text())
    assert description["urdf"] == "mine.urdf"
    description["mapping"]["left_arm"]["elbow"] = "right_forearm"
    (tmp_path / "mine.yaml").write_text(yaml.safe_dump(description))
    capsys.readouterr()
    assert main(["robot", "check", "mine.yaml"]) == 1
    assert "right_forearm does not hang on left_arm_root" in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize("kept", ["mine.yaml", "mine.png"])
def test_nothing_is_written_over(urdf, tmp_path, capsys, kept):
    (tmp_path / kept).write_text("made by hand")
    assert main(["robot", "add", urdf]) == 1
    assert "will not write over" in capsys.readouterr().err
    assert (tmp_path / kept).read_text() == "made by hand"
    assert {path.name for path in tmp_path.iterdir()} == {"mine.urdf", kept}


def test_arms_hang_anew_and_the_rest_of_the_file_stays(tmp_path, capsys):
    shutil.copy(URDF, tmp_path)
    path, lines = tmp_path / "mine.yaml", URDF.with_suffix(".yaml").read_text().splitlines()
    raised = [line.replace("rest: 0.10", "rest: 2.9") for line in lines]
    path.write_text("\n".join(raised))
    assert main(["robot", "check", str(path)]) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "above the shoulder: left and right" in told and "to look at, 0 bad" in told

    assert main(["robot", "rest", str(path)]) == 0
    assert "above the shoulder" not in " ".join(capsys.readouterr().out.split())
    written = path.read_text().splitlines()
    changed = [(old, new) for old, new in zip(raised, written, strict=True) if old != new]
    assert {new.split(":")[0].strip() for _, new in changed} >= {
        "left_shoulder_pitch",
        "right_shoulder_pitch",
    }
    angle = re.compile("rest: [-.0-9]*")
    assert all(angle.sub("", old) == angle.sub("", new) for old, new in changed)
    assert main(["robot", "rest", "toa"]) == 1


def test_toa_passes_its_check(capsys):
    assert main(["robot", "check", "toa"]) == 0
    assert "all is well" in capsys.readouterr().out


def test_what_no_servo_can_do_is_told(tmp_path, capsys):
    shutil.copy(URDF, tmp_path)
    text = URDF.with_suffix(".yaml").read_text()
    text = text.replace("acceleration: 20}", "acceleration: 2000}", 1).replace("1000000", "1234567")
    (tmp_path / "mine.yaml").write_text(text)
    assert main(["robot", "check", str(tmp_path / "mine.yaml")]) == 1
    told = " ".join(capsys.readouterr().out.split())
    assert "faster than 200 rad/s2: head_pan" in told and "no servo speaks at 1234567 bit/s" in told
    assert "1 to look at, 1 bad" in told
