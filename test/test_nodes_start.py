"""How the graph starts and ends: the user's parameters, and what tells it to end."""

import re
import signal

import pytest
from conftest import command, running

from gesture_bot.cli.main import main


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (None, "cannot read"),
        ("/**/servo_driver: [", "is not YAML"),
        ("/**/servo_drver: {ros__parameters: {rate: 50.0}}", "line 1: .*no such node: '/.*servo_driver"),
        ("\nservo_driver: {parameters: {rate: 50.0}}", "line 2: servo_driver.*ros__parameters"),
        ("/**: {ros__parameters: {robot: nao}}", "give robot:=... instead"),
    ],
)
def test_a_file_that_sets_no_parameters_is_told_before_anything_starts(tmp_path, capfd, text, told):
    file = tmp_path / "my.yaml"
    if text is not None:
        file.write_text(text)
    assert main(["run", f"parameters:={file}"]) == 1
    (line,) = capfd.readouterr().err.splitlines()
    assert line.startswith("gesture-bot: ") and str(file) in line
    assert re.search(told, line), line


@pytest.mark.parametrize(
    ("node", "text", "told"),
    [
        ("speech_source", "leed: 1.0", "my.yaml: speech_source has no parameter: 'leed'; valid: .*lead"),
        ("speech_source", "start_delay: 99.0", "parameter start_delay of speech_source"),
        ("speech_source", "lead: [1.0, two]", "my.yaml"),
        ("gesture_selector", "align_beats: 1", "align_beats of gesture_selector takes true or false: 1"),
        ("gesture_selector", "k: 5.0", "parameter k of gesture_selector takes a whole number: 5.0"),
    ],
)
def test_a_parameter_that_is_none_or_does_not_fit_ends_the_start(tmp_path, node, text, told):
    (tmp_path / "my.yaml").write_text(f"/**/{node}: {{ros__parameters: {{{text}}}}}")
    with running(command("run", f"parameters:={tmp_path / 'my.yaml'}")) as process:
        output, _ = process.communicate(timeout=60)
    assert process.returncode == 1
    assert "Traceback" not in output
    assert re.search(told, output), output


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_graph_that_still_starts_ends_quietly(number):
    with running(command("run", "loudspeaker:=off")) as process:
        assert "speech_source" in process.stdout.readline()
        process.send_signal(number)
        output, _ = process.communicate(timeout=60)
    assert process.returncode == 0
    assert "Traceback" not in output
    assert "servo_driver" not in output
