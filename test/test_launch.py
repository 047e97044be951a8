"""The launch file and the workspace build give what nodes/graph.py says."""

import importlib.util
import os
import re
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest
from conftest import running, wait_until

from gesture_bot.base.files import config_dir
from gesture_bot.nodes.graph import ARGUMENTS, COMMON, NODES

CHECKOUT = Path(__file__).resolve().parent.parent


def test_every_node_has_an_executable():
    installed = Path(sysconfig.get_path("data")) / "lib" / "gesture_bot"
    assert {path.name for path in installed.iterdir()} == {node.name for node in NODES}


def test_every_parameter_file_entry_is_a_node():
    import yaml

    entries = yaml.safe_load((config_dir() / "gesture_bot.yaml").read_text())
    assert {name.removeprefix("/**/") for name in entries} <= {node.name for node in NODES}


def test_launch_file_starts_the_graph():
    pytest.importorskip(
        "launch_ros", reason="ROS 2's launch library is not on PyPI; it comes with ROS 2 itself"
    )
    from launch.actions import DeclareLaunchArgument
    from launch_ros.actions import Node

    path = CHECKOUT / "launch" / "gesture_bot.launch.py"
    spec = importlib.util.spec_from_file_location("gesture_bot_launch", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    entities = module.generate_launch_description().entities
    declared = {entity.name: entity for entity in entities if isinstance(entity, DeclareLaunchArgument)}
    assert set(declared) == {argument.name for argument in (*ARGUMENTS, *COMMON)}
    assert all(entity.description for entity in declared.values())
    nodes = [entity for entity in entities if isinstance(entity, Node)]
    assert [node.node_executable for node in nodes] == [node.name for node in NODES]


def test_colcon_builds_a_workspace_whose_nodes_are_heard(tmp_path, listener):
    prefix = sysconfig.get_path("data")
    environment = dict(os.environ, AMENT_PREFIX_PATH=prefix, CMAKE_PREFIX_PATH=prefix)
    built = subprocess.run(
        ["colcon", "--log-base", str(tmp_path / "log"), "build", "--base-paths", str(CHECKOUT),
         "--build-base", str(tmp_path / "build"), "--install-base", str(tmp_path / "install"),
         "--cmake-args", f"-DPython3_EXECUTABLE={sys.executable}"],
        env=environment, capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert built.returncode == 0, built.stdout + built.stderr

    # The node must come from the workspace: the environment's own installation is not on its path.
    script = (
        f". {tmp_path}/install/setup.sh && python -c 'import gesture_bot.nodes as n; print(n.__file__)' "
        f"&& exec {tmp_path}/install/gesture_bot/lib/gesture_bot/gesture_refiner --ros-args -r __ns:=/w"
    )
    with running(["env", *(f"{k}={v}" for k, v in environment.items()), "sh", "-c", script]) as process:
        origin = process.stdout.readline()
        assert re.match(rf"{re.escape(str(tmp_path))}/install/", origin), origin
        wait_until(
            lambda: "/w/gesture/refined" in dict(listener.get_topic_names_and_types()),
            20.0, "a node of the workspace",
        )  # fmt: skip
