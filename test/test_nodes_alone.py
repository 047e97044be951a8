"""Each node by itself: it starts, says what it waits for, and describes its parameters."""

import json
import os
import re
import sysconfig
import time
from contextlib import ExitStack
from pathlib import Path

import pytest
from conftest import running, wait_until

from gesture_bot.base.files import config_dir
from gesture_bot.nodes.graph import NODES
from gesture_bot.retarget.robot import load_robot

pytestmark = pytest.mark.live

EXECUTABLES = Path(sysconfig.get_path("data")) / "lib" / "gesture_bot"


@pytest.fixture(scope="module")
def alone(demo_corpus):
    """All nodes, each in a process and a namespace of its own: {name: (process, output lines)}."""
    with ExitStack() as stack:
        nodes = {}
        for node in NODES:
            process = stack.enter_context(
                running([str(EXECUTABLES / node.name), "--ros-args", "-r", f"__ns:=/alone/{node.name}"])
            )
            os.set_blocking(process.stdout.fileno(), False)
            nodes[node.name] = (process, [])
        give_up = time.monotonic() + 60
        while any(not lines for _, lines in nodes.values()) and time.monotonic() < give_up:
            for _process, lines in nodes.values():
                lines.extend(iter(_process.stdout.readline, ""))
            time.sleep(0.1)
        yield nodes


@pytest.mark.parametrize("name", [node.name for node in NODES])
def test_says_what_it_waits_for(alone, name):
    process, lines = alone[name]
    assert process.poll() is None, "".join(lines)
    waits = [line for line in lines if "waits for" in line]
    assert len(waits) == 1, lines


def test_parameters_are_described(alone, listener):
    from rcl_interfaces.srv import DescribeParameters, ListParameters

    for graph_node in NODES:
        prefix = f"/alone/{graph_node.name}/{graph_node.name}"
        listed = _call(listener, ListParameters, f"{prefix}/list_parameters", ListParameters.Request())
        ours = [name for name in listed.result.names if "." not in name and name not in ROS_PARAMETERS]
        assert set(graph_node.arguments) <= set(ours)
        described = _call(
            listener,
            DescribeParameters,
            f"{prefix}/describe_parameters",
            DescribeParameters.Request(names=ours),
        )
        for descriptor in described.descriptors:
            assert len(descriptor.description) > 10, (graph_node.name, descriptor.name)
            assert descriptor.read_only == (descriptor.name not in LIVE_PARAMETERS)


LIVE_PARAMETERS = {"virtual_fault"}
"""These may be set at any time."""

ROS_PARAMETERS = {"use_sim_time", "start_type_description_service"}


def _call(node, service, name, request):
    client = node.create_client(service, name)
    assert client.wait_for_service(10.0), name
    future = client.call_async(request)
    wait_until(future.done, 10.0, name)
    node.destroy_client(client)
    return future.result()


def test_each_node_says_how_it_is(alone, listener):
    from diagnostic_msgs.msg import DiagnosticStatus

    parts = {node.name.replace("_", " ") for node in NODES} - {"servo driver"} | {"servo bus"}
    said = {}

    def all_have():
        for heard in listener.record.diagnostics:
            said.update((status.name, status) for status in heard.message.status)
        return {f"gesture_bot: {part}" for part in parts} <= set(said)

    wait_until(all_have, 15, "a status of each node")
    bad = {name: said[name].message for name in said if said[name].level == DiagnosticStatus.ERROR}
    assert not bad
    assert said["gesture_bot: servo left_elbow"].hardware_id == "XL430-W250, ID 14"


SHOWN = {
    "/robot_description": "std_msgs/msg/String",
    "/joint_states": "sensor_msgs/msg/JointState",
    "/gesture/markers": "visualization_msgs/msg/MarkerArray",
    "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
    "/say": "std_msgs/msg/String",
}
"""What panels of Foxglove show, or publish on, and the types that they take."""


def test_foxglove_is_shown_topics_of_the_nodes(alone, listener):
    text = (config_dir() / "gesture_bot.foxglove.json").read_text()
    assert set(re.findall(r'"(/[a-z_/]+)', text)) == set(SHOWN)
    panels = json.loads(text)["configById"]
    labels = [path["label"] for path in panels["Plot!joints"]["paths"]]
    assert labels == list(load_robot("toa").joints)
    assert panels["Publish!say"]["datatype"] == SHOWN["/say"]

    def published():
        topics = listener.get_topic_names_and_types()
        types = {re.sub(r"^/alone/\w+", "", topic): kinds for topic, kinds in topics}
        return all(types.get(topic) == [kind] for topic, kind in SHOWN.items())

    wait_until(published, 10, "the topics of the layout")
