"""The selector's node by itself: controls, emotions and diagnostics on the topics."""

import os
import re
import signal
import sysconfig
import time
from pathlib import Path

import pytest
from conftest import running, wait_until
from diagnostic_msgs.msg import DiagnosticStatus
from small_database import small_database

from gesture_bot.msg import Constraint, Control, Emotion
from gesture_bot.nodes.node import PLAN, STATE, stamp

pytestmark = pytest.mark.live

EXECUTABLE = Path(sysconfig.get_path("data")) / "lib" / "gesture_bot" / "gesture_selector"

HIGH = Constraint(quantity="wrist_height", value=80.0)


@pytest.fixture
def node(listener, tmp_path, monkeypatch):
    """The node on a small database, where a package hri_msgs is installed: here one with our own message."""
    (tmp_path / "hri_msgs").mkdir()
    (tmp_path / "hri_msgs" / "msg.py").write_text("from gesture_bot.msg import Emotion as Expression")
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}{os.pathsep}{os.environ.get('PYTHONPATH', '')}")
    small_database().save(tmp_path / "small.safetensors")
    with running(
        [str(EXECUTABLE), "--ros-args", "-p", f"database:={tmp_path / 'small.safetensors'}"]
    ) as process:
        wait_until(lambda: listener.record.states, 30, "the selector's state")
        listener.process = process
        yield listener


@pytest.fixture
def ask(node):
    """Publishes constraints on `control`."""
    control = node.create_publisher(Control, "control", STATE)
    wait_until(lambda: control.get_subscription_count() >= 2, 10, "the selector on control")

    def publish(*constraints, asked=0.0):
        message = Control(constraints=constraints)
        message.header.stamp = stamp(asked)
        control.publish(message)

    return publish


def state(node):
    return node.record.states[-1].message


def asked_for(node):
    """What each constraint in force is about."""
    return [constraint.quantity for constraint in state(node).constraints]


def test_a_duration_counts_from_the_stamp_and_its_end_is_published(node, ask):
    short = Constraint(quantity="hand_span", value=20.0, duration=3.0)
    label = Constraint(quantity="emotion", labels=["sad", "angry"])
    for stamped, expected in ((False, 3.0), (True, 1.5)):
        before = node.now()
        ask(short, label, asked=before - 1.5 if stamped else 0.0)
        wait_until(lambda: asked_for(node) == ["hand_span", "emotion"], 5, "the controls")
        assert state(node).constraints[0].duration == 3.0
        assert state(node).constraints[1].labels == ["sad", "angry"]
        wait_until(lambda: asked_for(node) == ["emotion"], 5, "the end of the first one")
        assert node.now() - before == pytest.approx(expected, abs=0.5)


def status(node):
    statuses = [status for heard in node.record.diagnostics for status in heard.message.status]
    return next(s for s in reversed(statuses) if s.name == "gesture_bot: gesture selector")


def test_what_gives_way_is_said(node, ask):
    wait_until(lambda: node.record.diagnostics, 5, "a diagnostic")
    assert status(node).level == DiagnosticStatus.OK
    low = Constraint(quantity="wrist_height", bound="at_most", value=20.0, priority=1)
    ask(HIGH, low)
    wait_until(lambda: state(node).relaxed, 5, "the state")
    assert state(node).relaxed[0].startswith("both wrist_height at least percentile 80: relaxed to ")
    assert 0 < state(node).eligible < 0.2
    wait_until(lambda: status(node).level == DiagnosticStatus.WARN, 5, "the diagnostic")
    assert state(node).relaxed[0] in status(node).message
    ask()
    wait_until(lambda: status(node).level == DiagnosticStatus.OK, 5, "the diagnostic")
    assert list(state(node).relaxed) == []


def test_a_bad_control_is_answered_in_one_line_and_the_ones_before_stand(node, ask):
    ask(HIGH)
    wait_until(lambda: asked_for(node) == ["wrist_height"], 5, "the control")
    before = len(node.record.states)
    bad = {
        "'nose_height'; valid: wrist_height, .*hand_span, emotion, style, speaker": Constraint(
            quantity="nose_height"
        ),
        "value of a control on hand_span: nan; valid: a finite number": Constraint(
            quantity="hand_span", value=float("nan")
        ),
        "hand of a control on hand_span: 'left'; valid: both": Constraint(quantity="hand_span", hand="left"),
        "-2.0; valid: 0 s or more": Constraint(quantity="hand_span", duration=-2.0),
        "'glad'; valid: neutral, sad, angry": Constraint(quantity="emotion", labels=["sad", "glad"]),
        "labels of a control on style": Constraint(quantity="style"),
    }
    for constraint in bad.values():
        ask(HIGH, constraint)
        time.sleep(0.3)
    assert len(node.record.states) == before
    wait_until(lambda: "refused control: " in status(node).message, 5, "the diagnostic")
    assert status(node).level == DiagnosticStatus.WARN
    node.process.send_signal(signal.SIGINT)
    lines = node.process.stdout.read().splitlines()
    for expected in bad:
        said = [line for line in lines if re.search(f"ERROR.*control: .*{expected}", line)]
        assert len(said) == 1, (expected, said)
    assert not any("Traceback" in line for line in lines)


def test_an_expression_of_hri_msgs_is_an_emotion(node):
    publisher = node.create_publisher(Emotion, "/robot_face/expression", PLAN)
    wait_until(publisher.get_subscription_count, 10, "the selector on robot_face/expression")
    publisher.publish(Emotion(expression="sad"))
    wait_until(lambda: state(node).expression == "sad", 5, "the emotion")
    publisher.publish(Emotion(valence=0.8, arousal=0.4))
    wait_until(lambda: state(node).expression == "happy", 5, "the emotion")
