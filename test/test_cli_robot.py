"""`gesture-bot robot`: from a URDF to a mapping that gestures, and what it says of a wrong one."""

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


def test_a_mapping_is_not_written_over(urdf, tmp_path, capsys):
    (tmp_path / "mine.yaml").write_text("corrected by hand")
    assert main(["robot", "add", urdf]) == 1
    assert "will not write over" in capsys.readouterr().err
    assert (tmp_path / "mine.yaml").read_text() == "corrected by hand"


def test_toa_passes_its_check(capsys):
    assert main(["robot", "check", "toa"]) == 0
    lines = capsys.readouterr().out
    assert "bad" not in lines
    assert "look " not in lines
