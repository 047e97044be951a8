"""`gesture-bot doctor` on this machine, and on one where things are wrong."""

import os
import subprocess

import pytest
from conftest import command

pytestmark = pytest.mark.live


def doctor(**environment):
    """The exit status, and what was found, by check."""
    environment = {**os.environ, "COLUMNS": "300", **environment}
    result = subprocess.run(
        command("doctor"), capture_output=True, text=True, timeout=60, check=False, env=environment
    )
    lines = [line.split(maxsplit=1) for line in result.stdout.replace("ROS 2", "ROS").splitlines()]
    return result.returncode, {line[0]: line[1] for line in lines if len(line) == 2}, result.stdout


def test_a_machine_that_runs_these_tests_is_well():
    status, found, output = doctor()
    assert status == 0, output
    for check in ("Python", "processor", "ROS", "middleware", "traffic"):
        assert found[check].startswith("ok "), output


def test_what_is_wrong_is_named_and_hides_nothing_else():
    status, found, output = doctor(XDG_CACHE_HOME="/proc/none", ROS_DOMAIN_ID="mine")
    assert status == 1, output
    assert found["cache"].startswith("folder  bad ") and "/proc/none/gesture_bot" in found["cache"]
    assert found["domain"].startswith("bad ") and "'mine'" in found["domain"]
    assert found["loudspeaker"]


def test_a_machine_without_rclpy_is_told_so(tmp_path):
    (tmp_path / "rclpy.py").write_text("raise ImportError('no rclpy here')")
    status, found, output = doctor(PYTHONPATH=f"{tmp_path}{os.pathsep}{os.environ.get('PYTHONPATH', '')}")
    assert status == 1, output
    assert "bad " in output and "Traceback" not in output
    assert found["loudspeaker"]
