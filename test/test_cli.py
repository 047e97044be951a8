"""The `gesture-bot` command, as a user types it."""

import json
import subprocess

import bvhio
import numpy as np
import pytest
import soundfile
from conftest import command
from PIL import Image
from trajectory_msgs.msg import JointTrajectory

from gesture_bot.retarget.robot import load_robot
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.voice import load_voice


def run(*arguments, timeout=60):
    """The finished process of one command."""
    return subprocess.run(command(*arguments), capture_output=True, text=True, timeout=timeout, check=False)


@pytest.fixture(scope="module")
def speech(tmp_path_factory):
    """A sound file of three seconds."""
    path = tmp_path_factory.mktemp("speech") / "speech.wav"
    samples = load_voice("embedded").speak("People sell bread and flowers on the old market.").samples
    soundfile.write(path, samples, SAMPLE_RATE)
    return path


@pytest.mark.live  # the others run no graph
def test_demo_shows_all_and_writes_its_files(demo_corpus, tmp_path):
    result = run("demo", "-o", str(tmp_path / "out"), timeout=150)
    assert result.returncode == 0, result.stdout + result.stderr
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["limit_violations"] == 0
    assert summary["joint_jumps"] == 0
    assert summary["max_velocity_rad_s"] < 1.1 * load_robot("toa").limits.velocity.max()
    assert summary["emotion_changes"] >= 2
    assert summary["teleop_takeovers"] == 1
    assert summary["frames_selected"] > 200
    assert summary["max_velocity_rad_s"] > 1.0
    made = [word for word in summary["keywords"] if word["stroke_time"] is not None]
    assert len(made) >= 2
    assert np.median([abs(word["stroke_time"] - word["word_time"]) for word in made]) < 0.2
    assert summary["latency_ms"]["bus"]["median"] < 50

    joints = np.genfromtxt(tmp_path / "out" / "joint_states.csv", delimiter=",", names=True)
    assert joints.dtype.names == ("time", *load_robot("toa").joints)
    assert len(joints) / np.ptp(joints["time"]) >= 50
    sound = soundfile.info(tmp_path / "out" / "speech.wav")
    assert 20 < sound.duration < 60
    with Image.open(tmp_path / "out" / "gesture.gif") as film:
        assert film.n_frames > 200
    with Image.open(tmp_path / "out" / "timeline.png") as timeline:
        assert timeline.width > 1000


@pytest.mark.live
def test_demo_refuses_company(demo_corpus, listener, tmp_path):
    listener.create_publisher(JointTrajectory, "joint_trajectory", 1)
    result = run("demo", "-o", str(tmp_path / "out"))
    assert result.returncode == 1
    assert "a graph is running already" in result.stderr


def test_render_writes_the_same_motion_again(demo_corpus, speech, tmp_path):
    for name in ("a.csv", "b.csv"):
        result = run("render", str(speech), "-o", str(tmp_path / name))
        assert result.returncode == 0, result.stderr
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()
    motion = np.genfromtxt(tmp_path / "a.csv", delimiter=",", names=True)
    limits = load_robot("toa").limits
    for joint, lower, upper in zip(limits.joints, limits.lower, limits.upper, strict=True):
        assert lower <= motion[joint].min() <= motion[joint].max() <= upper
    assert np.ptp(motion["right_elbow"]) > 0.2


def test_render_writes_bvh_and_gif(demo_corpus, speech, tmp_path):
    for name in ("motion.bvh", "motion.gif"):
        result = run("render", str(speech), "-o", str(tmp_path / name), "--emotion", "happy")
        assert result.returncode == 0, result.stderr
    skeleton = bvhio.readAsBvh(str(tmp_path / "motion.bvh"))
    seconds = soundfile.info(speech).duration
    assert skeleton.FrameCount * skeleton.FrameTime == pytest.approx(seconds + 1, abs=0.2)
    with Image.open(tmp_path / "motion.gif") as film:
        assert film.n_frames > 20


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["render", "{text}", "-o", "x.csv"], "speech.txt"),
        (["render", "{wav}", "-o", "x.mp4"], "valid: .bvh, .csv, .gif"),
        (["render", "{wav}", "-o", "x.csv", "--emotion", "sadd"], "'sadd'; valid: "),
        (["run", "speech:={text}"], "speech.txt"),
        (["run", "emotion:=sadd"], "'sadd'; valid: "),
        (["run", "port:=/dev/ttyNONE"], "/dev/ttyNONE"),
        (["run", "robot:=atlas"], "'atlas'; valid: toa"),
        (["run", "robot:={robot}"], "'left_elbow'; valid: "),
        (["run", "speach:=say"], "'speach'; valid: speech, text"),
        (["run", "seed:=many"], "'many'"),
        (["run", "database:={text}"], "speech.txt"),
        (["demo", "robot:=atlas"], "'atlas'; valid: toa"),
        (["demo", "seed:=1"], "'seed'; valid: robot"),
        (["demo", "-o", "{text}"], "speech.txt/graph.log"),
        (["run", "voice:=bob", "text:=Hello"], "'bob'; valid: embedded"),
    ],
)
def test_wrong_input_is_named_in_one_line(demo_corpus, speech, tmp_path, arguments, named):
    text = tmp_path / "speech.txt"
    text.write_text("Hello")
    result = run(*(a.format(wav=speech, text=text, robot=without_elbow(tmp_path)) for a in arguments))
    assert result.returncode == 1
    errors = [line for line in result.stderr.splitlines() if not line.startswith(("[INFO]", "[WARN]"))]
    assert len(errors) == 1, result.stderr
    assert named in errors[0]


def without_elbow(folder):
    """The YAML of a robot whose URDF lacks a joint that its servo table names."""
    from gesture_bot.base.files import config_dir

    robots = config_dir() / "robots"
    urdf = (robots / "toa.urdf").read_text().replace('<joint name="left_elbow"', '<joint name="left_elbo"')
    (folder / "toa.urdf").write_text(urdf)
    (folder / "toa.yaml").write_text((robots / "toa.yaml").read_text())
    return folder / "toa.yaml"


def test_help_says_what_to_type_next():
    result = run()
    assert result.returncode == 0
    assert "gesture-bot demo" in result.stdout


def test_an_option_of_run_is_told_to_be_an_argument():
    result = run("run", "--emotion", "happy")
    assert result.returncode == 2
    assert "--emotion; those of run, demo and replay are written NAME:=VALUE" in result.stderr


@pytest.mark.parametrize(("arguments", "named"), [(["servos"], "WHAT"), (["replay"], "FILE.mcap")])
def test_a_command_line_that_lacks_something_says_where_to_read_on(arguments, named):
    result = run(*arguments)
    assert result.returncode == 2
    assert result.stderr.endswith(f"required: {named}\nTry: gesture-bot {arguments[0]} --help\n")
