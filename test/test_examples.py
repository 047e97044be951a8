"""The programs of examples/, all at once beside one running graph, as users run them."""

import re
import signal
import subprocess
import sys
import time
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
from conftest import command, listening, running, wait_until
from std_msgs.msg import String

from gesture_bot.nodes.graph import NODES
from gesture_bot.nodes.node import PLAN, seconds
from gesture_bot.retarget.robot import load_robot

pytestmark = pytest.mark.live

ROOT = Path(__file__).parents[1]
EXAMPLES = ROOT / "examples"
ENDING = ("emotions.py", "controls.py", "own_voice.py", "teleop.py")
LASTING = {"own_recogniser.py": ["voice"], "watch.py": []}


def program(name, *arguments):
    return [sys.executable, "-u", str(EXAMPLES / name), *arguments]


@pytest.fixture(scope="module")
def lasting():
    """Programs that wait for a graph. Started before it, they know all of it by the time that it moves."""
    with ExitStack() as stack:
        yield {
            name: stack.enter_context(running(program(name, *arguments)))
            for name, arguments in LASTING.items()
        }


@pytest.fixture(scope="module")
def graph(demo_corpus, lasting):
    # A microphone that is not there: the node has its topics, and hears nobody.
    with listening() as listener, running(command("run", "microphone:=none of all")):
        # As one who records: it is no reason to speak before the robot listens.
        listener.create_subscription(String, "say", lambda _: None, PLAN)
        wait_until(lambda: listener.record.joint_states and listener.record.refined, 120, "the graph to move")
        yield listener


@pytest.fixture(scope="module")
def seen(graph, lasting):
    """What was on the topics, and what each program printed."""
    outputs = {}
    with ExitStack() as stack:
        assert lasting["own_recogniser.py"].stdout.readline() == "listens\n"

        # Alone, since the emotions of others change the voice.
        def understood():
            """Sound is best effort: with a piece of it, a word may be lost. Then it is said again."""
            outputs["talk.py"] = subprocess.check_output(program("talk.py"), text=True, timeout=60)
            time.sleep(5.0)
            return "hello" in {w.message.text for w in graph.record.words}

        wait_until(understood, 30, "the word")
        ending = {name: stack.enter_context(running(program(name))) for name in ENDING}
        for name, process in ending.items():
            outputs[name], _ = process.communicate(timeout=120)
            assert process.returncode == 0, f"{name}: {outputs[name]}"
        wait_until(
            lambda: {"my_voice"} <= {w.message.header.frame_id for w in graph.record.words}, 10, "words"
        )
        for arguments in [], ["reset"]:
            subprocess.run(program("stop.py", *arguments), check=True, timeout=60)
        for name, process in lasting.items():
            process.send_signal(signal.SIGINT)
            outputs[name], _ = process.communicate(timeout=60)
    return graph.record, outputs


def test_texts_and_voices_are_heard(seen):
    record, outputs = seen
    said = [heard.message.text for heard in record.words if heard.message.header.frame_id == "voice"]
    assert "Hello I am glad to see you" in " ".join(said)
    assert outputs["emotions.py"].count("heard") == 3
    assert "my_voice" in {k.message.header.frame_id for k in record.keywords if k.message.gesture == "hello"}
    parts = {status.name for heard in record.diagnostics for status in heard.message.status}
    assert "gesture_bot: sound of my_voice" in parts


def test_the_robot_moves_inside_its_limits(seen):
    record, _ = seen
    said = [heard.message.text for heard in record.words if heard.message.header.frame_id == "voice"]
    assert said[:2] == ["Hello", "I"]
    assert "hello" in [k.message.gesture for k in record.keywords if k.message.header.frame_id == "voice"]
    assert {"speech", "bank", "rest"} <= {heard.message.source for heard in record.selected}

    times, positions = record.joint_positions()
    assert len(times) / (times[-1] - times[0]) >= 50
    limits = load_robot("toa").limits
    tick = 2 * np.pi / 4096
    assert (positions >= limits.lower - tick).all()
    assert (positions <= limits.upper + tick).all()
    assert (np.ptp(positions, axis=0) > 0.3).sum() >= 4, "the arms should have moved"


def test_a_recogniser_hears_the_word_where_it_is(seen):
    record, outputs = seen
    known, heard = (
        [seconds(one.message.header.stamp) for one in record.words if one.message.text == text]
        for text in ("Hello", "hello")
    )
    assert "hello" in outputs["own_recogniser.py"]
    assert min(abs(mine - theirs) for mine in heard for theirs in known) < 0.3


def test_emotions_and_controls_come_one_after_the_other(seen):
    record, _ = seen
    felt = [state.message.expression for state in record.states]
    assert re.search("happy.* sad.* angry.* neutral", " ".join(felt))
    asked = [[c.quantity for c in state.message.constraints] for state in record.states]
    first, second = asked.index(["wrist_height"]), asked.index(["wrist_speed", "hand_radius"])
    assert first < second < len(asked) - asked[::-1].index([])


def test_a_joint_is_taken_and_given_back(seen):
    record, outputs = seen
    owners = [dict(zip(o.message.joints, o.message.owners, strict=True)) for o in record.owners]
    assert {"joint": "teleop", "other": "gesture"} in [
        {"joint": one["right_elbow"], "other": one["left_elbow"]} for one in owners
    ]
    assert owners[-1]["right_elbow"] != "teleop"
    assert all(
        re.search(rf"{joint} .* rad  moved by", outputs["watch.py"]) for joint in load_robot("toa").joints
    )


def test_a_stop_holds_until_it_is_reset(seen):
    record, _ = seen
    owners = [set(o.message.owners) for o in record.owners]
    assert {"stop"} in owners
    assert "stop" not in owners[-1]


def test_the_drawn_graph_is_the_running_one(graph):
    page = (ROOT / "docs" / "08-how-it-works.md").read_text()
    drawn = re.findall(r'^  (\w+) -- "(\S+)" --> (\w+)$', page, re.MULTILINE)
    always = {node.name for node in NODES if not node.switch}
    assert always | {"you"} == {name for one in drawn for name in (one[0], one[2])}
    for talker, topic, hearer in drawn:
        talkers = {info.node_name for info in graph.get_publishers_info_by_topic(topic)}
        # What has to be heard at once has a node of its own, such as servo_driver_urgent.
        hearing = graph.get_subscriptions_info_by_topic(topic)
        hearers = {info.node_name.removesuffix("_urgent") for info in hearing}
        assert talker in talkers and hearer in {"you", *hearers}, topic


def test_every_example_is_run_here():
    assert {path.name for path in EXAMPLES.iterdir()} == {
        *ENDING, *LASTING, "talk.py", "stop.py", "build_bank.py", "add_robot.sh",
        "swing_joint.py", "own_recordings.py",
    }  # fmt: skip
