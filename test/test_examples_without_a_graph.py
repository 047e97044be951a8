"""The programs of examples/ that need no running graph, as users run them."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import command

from gesture_bot.base.files import config_dir
from gesture_bot.base.keypoints import INDEX
from gesture_bot.corpus.database import Database

EXAMPLES = Path(__file__).parents[1] / "examples"


def program(name, *arguments):
    return [sys.executable, str(EXAMPLES / name), *arguments]


def test_a_robot_and_a_bank_of_ones_own(demo_corpus, tmp_path):
    (tmp_path / "mine.urdf").write_text((config_dir() / "robots" / "toa.urdf").read_text())
    for arguments in (program("build_bank.py"), ["sh", str(EXAMPLES / "add_robot.sh"), "mine.urdf"]):
        subprocess.run(arguments, cwd=tmp_path, check=True, timeout=120)
    assert "salute" in (tmp_path / "my_banks" / "mine.yaml").read_text()
    assert {"mine.yaml", "mine.png", "mine.gif"} <= {path.name for path in tmp_path.iterdir()}


def test_a_joint_swings_without_ros():
    told = subprocess.check_output(program("swing_joint.py", "toa", "left_elbow"), text=True, timeout=120)
    begin, farthest, end = map(float, re.findall(r"(-?[\d.]+) rad", told))
    assert abs(farthest - begin) == pytest.approx(0.2, abs=0.1)
    assert end == pytest.approx(begin, abs=0.02)


def test_recordings_of_ones_own_form_become_a_database(tmp_path):
    build = "build-database my_recordings --map my_map.yaml --labels my_labels.csv -o mine.safetensors"
    for arguments in program("own_recordings.py"), command(*build.split()):
        subprocess.run(arguments, cwd=tmp_path, check=True, timeout=120)
    database = Database.load(tmp_path / "mine.safetensors")
    assert {database.label(sequence, "speaker") for sequence in range(len(database.starts))} == {"me"}
    heights = database.keypoints[:, [INDEX["left_wrist"], INDEX["right_wrist"]], 2].astype(float)
    assert np.corrcoef(heights.T)[0, 1] < -0.9, "one hand goes up while the other goes down"
