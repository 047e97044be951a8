"""The running graph, from text to measured joints, as a user sees it on the topics."""

import re
import signal
import time

import numpy as np
import pytest
import soundfile
from action_msgs.msg import GoalStatus
from conftest import command, running, wait_until
from rclpy.action import ActionClient
from std_msgs.msg import Bool, String
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory as JointTrajectoryMessage

from gesture_bot.action import Speak
from gesture_bot.base.frames import FRAME_RATE
from gesture_bot.base.keypoints import INDEX
from gesture_bot.base.trajectory import JointTrajectory
from gesture_bot.evaluate.motion_report import motion_report
from gesture_bot.msg import Constraint, Control, Emotion
from gesture_bot.nodes.messages import clip_from, trajectory_to
from gesture_bot.nodes.node import PLAN, STATE, seconds
from gesture_bot.retarget.robot import load_robot
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.voice import load_voice

pytestmark = pytest.mark.live

TEXT = (
    "Hello, today we walk along the river and count the boats that pass, and then we go on to the old "
    "market, where people sell bread and flowers, and in the evening we sit by the fire and tell stories."
)


@pytest.fixture
def graph(listener, demo_corpus):
    """The whole graph in one process, and a node that listens and publishes."""
    with running(command("run")) as process:
        wait_until(lambda: listener.record.joint_states and listener.record.refined, 40, "the graph to move")
        listener.process = process
        yield listener


@pytest.fixture
def say(graph):
    publisher = graph.create_publisher(String, "say", PLAN)
    wait_until(publisher.get_subscription_count, 10, "somebody to listen on say")
    return lambda text: publisher.publish(String(data=text))


def refined_wrists(record, begin, end):
    """(n, 2, 3) left and right wrist of the refined frames seen between two moments [m]."""
    frames = {}
    for heard in record.refined:
        clip = clip_from(heard.message)
        frames.update(enumerate(clip.keypoints, clip.start))
    wanted = [frames[f] for f in sorted(frames) if begin <= f / FRAME_RATE < end]
    return np.array(wanted)[:, [INDEX["left_wrist"], INDEX["right_wrist"]]]


def speech_end(record):
    """The moment at which the last utterance's sound ends, once all of it is out."""
    last = record.audio[-1]
    return last.stamp + len(last.message.samples) / last.message.sample_rate if last.message.last else None


def test_emotion_changes_the_speed_and_control_the_height(graph, say):
    emotion = graph.create_publisher(Emotion, "emotion", STATE)
    control = graph.create_publisher(Control, "control", STATE)
    say(f"{TEXT} {TEXT} {TEXT}")
    wait_until(lambda: graph.record.audio, 20, "speech")
    begin = graph.record.audio[0].stamp
    changes = {}
    for name, at, message in (
        ("sad", 0.0, Emotion(expression="sad")),
        ("angry", 7.0, Emotion(expression="angry")),
        ("neutral", 14.0, Emotion(expression="neutral")),
    ):
        wait_until(lambda at=at: graph.now() >= begin + at, 20, name)
        changes[name] = graph.now()
        emotion.publish(message)
    wait_until(lambda: graph.now() >= changes["neutral"] + 7, 20, "neutral speech")
    high = Constraint(quantity="wrist_height", hand="left", value=85.0, unit="percentile")
    control.publish(Control(constraints=[high]))
    changes["high"] = graph.now()
    wait_until(lambda: graph.now() >= changes["high"] + 6, 20, "controlled speech")
    assert graph.now() < (speech_end(graph.record) or np.inf), "the speech was too short for this test"

    def speed(name, after, length):
        wrists = refined_wrists(graph.record, changes[name] + after, changes[name] + after + length)
        return np.linalg.norm(np.diff(wrists, axis=0), axis=-1).mean() * FRAME_RATE

    assert speed("angry", 2.0, 4.5) >= 1.5 * speed("sad", 2.0, 4.5)

    def left_height(name):
        return refined_wrists(graph.record, changes[name] + 2.0, changes[name] + 5.5)[:, 0, 2].mean()

    assert left_height("high") > left_height("neutral") + 0.05
    state = graph.record.states[-1].message
    assert state.constraints[0].quantity == "wrist_height"
    assert 0 < state.eligible < 0.5


def test_bad_messages_change_nothing(graph):
    emotion = graph.create_publisher(Emotion, "emotion", STATE)
    control = graph.create_publisher(Control, "control", STATE)
    wait_until(lambda: graph.record.states, 10, "the selector's state")
    wait_until(control.get_subscription_count, 10, "the selector")
    before = len(graph.record.states)
    emotion.publish(Emotion(expression="sadd"))
    for quantity, value in (("wrist_height", float("nan")), ("wrist_hight", 0.1)):
        control.publish(Control(constraints=[Constraint(quantity=quantity, value=value)]))
        time.sleep(0.5)
    assert len(graph.record.states) == before
    graph.process.send_signal(signal.SIGINT)
    output = graph.process.stdout.read()
    assert re.search("'sadd'; valid: .*neutral.*sad", output)
    assert "nan" in output
    assert "'wrist_hight'; valid: wrist_height, " in output
    assert "Traceback" not in output


def test_operator_takes_an_arm_and_gives_it_back_and_stop_latches(graph, say):
    robot = load_robot("toa")
    say(TEXT)
    wait_until(lambda: graph.record.audio, 20, "speech")
    teleop = graph.create_publisher(JointTrajectoryMessage, "teleop/joint_trajectory", PLAN)
    wait_until(teleop.get_subscription_count, 10, "the mux")
    elbow = robot.joints.index("left_elbow")
    target = 0.5 * (robot.limits.lower[elbow] + robot.limits.upper[elbow])

    taken = graph.now()
    while graph.now() < taken + 3.0:
        now = graph.now()
        teleop.publish(
            trajectory_to(
                JointTrajectory(
                    ("left_elbow",), now + np.array([0.0, 0.3]), np.full((2, 1), target), np.zeros((2, 1))
                )
            )
        )
        time.sleep(0.1)
    _times, positions = graph.record.joint_positions()
    assert positions[-1, elbow] == pytest.approx(target, abs=0.03)
    assert np.ptp(positions[-150:, robot.joints.index("right_elbow")]) > 0.02, "the other arm goes on"
    wait_until(
        lambda: "teleop" not in graph.record.owners[-1].message.owners,
        5,
        "the operator's arm to be given back",
    )

    reset = graph.create_client(Trigger, "reset")
    stop = graph.create_publisher(Bool, "stop", PLAN)
    wait_until(stop.get_subscription_count, 10, "the mux")
    stop.publish(Bool(data=True))
    time.sleep(0.6)
    stopped = len(graph.record.joint_states)
    time.sleep(1.0)
    _, positions = graph.record.joint_positions()
    assert np.ptp(positions[stopped:], axis=0).max() < 0.005, "a stop holds"
    reset.call_async(Trigger.Request())
    moved = len(graph.record.joint_states)
    time.sleep(2.5)
    _, positions = graph.record.joint_positions()
    assert np.ptp(positions[moved:], axis=0).max() > 0.02, "a reset lets the gestures go on"


def test_an_urgent_text_cuts_the_one_before_short(graph):
    client = ActionClient(graph, Speak, "speak")
    assert client.wait_for_server(10)
    told = {"old": [], "new": []}
    results = {}

    def speak(name, **goal):
        def on_goal(future):
            future.result().get_result_async().add_done_callback(
                lambda done: results.update({name: done.result()})
            )

        sent = client.send_goal_async(Speak.Goal(**goal), lambda heard: told[name].append(heard.feedback))
        sent.add_done_callback(on_goal)

    speak("old", text=TEXT)
    wait_until(lambda: len(told["old"]) > 6, 30, "the first words")
    assert [one.word for one in told["old"]][:4] == ["", "Hello", "today", "we"]
    asked = graph.now()
    speak("new", text="Stop. Please go away from the table.", urgent=True)
    wait_until(lambda: "new" in results, 30, "the end of the urgent text")
    assert results["old"].status == GoalStatus.STATUS_ABORTED
    assert not results["old"].result.spoken
    assert results["old"].result.message == "an urgent text came"
    assert results["new"].result.spoken
    words = [one.word for one in told["new"]]
    assert words == ["", "Stop", "Please", "go", "away", "from", "the", "table"]

    numbers = [heard.message.utterance for heard in graph.record.audio]
    assert numbers == sorted(numbers) and set(numbers) == {1, 2}
    old = [heard for heard in graph.record.audio if heard.message.utterance == 1]
    assert old[-1].arrival < asked + 0.2, "nothing of the old text is given out any more"
    begin = seconds(told["new"][0].moment)
    shown = {}
    for heard in graph.record.selected:
        clip = clip_from(heard.message)
        shown = {frame: source for frame, source in shown.items() if frame < clip.start}
        shown.update(dict.fromkeys(range(clip.start, clip.stop), heard.message.source))
    between = {source for frame, source in shown.items() if asked + 0.25 < frame / FRAME_RATE < begin - 0.5}
    assert between == {"rest"}


def test_a_cancelled_text_is_silent_and_the_next_goes_on(graph):
    client = ActionClient(graph, Speak, "speak")
    assert client.wait_for_server(10)
    goals, results = [], {}
    for number, text in enumerate((TEXT, "Now I speak.", " ... ")):
        sent = client.send_goal_async(Speak.Goal(text=text))
        wait_until(sent.done, 10, "the goal to be accepted")
        goals.append(sent.result())
        goals[-1].get_result_async().add_done_callback(
            lambda done, number=number: results.update({number: done.result()})
        )
    wait_until(lambda: graph.record.audio and graph.now() > graph.record.audio[0].stamp + 1.0, 20, "speech")
    cancelled = graph.now()
    goals[0].cancel_goal_async()
    wait_until(lambda: len(results) == 3, 20, "the end of all")
    assert results[0].status == GoalStatus.STATUS_CANCELED
    assert results[1].result.spoken
    assert "nothing that can be spoken" in results[2].result.message
    assert graph.now() - cancelled < 6


def test_interrupt_ends_it_within_two_seconds(graph, say):
    say(TEXT)
    wait_until(lambda: graph.record.audio, 20, "speech")
    time.sleep(2.0)
    graph.process.send_signal(signal.SIGINT)
    begin = time.monotonic()
    time.sleep(0.2)
    graph.process.send_signal(signal.SIGINT)  # an impatient second one changes nothing
    assert graph.process.wait(5) == 0
    assert time.monotonic() - begin < 2.0
    assert "Traceback" not in graph.process.stdout.read()


def test_a_sound_file_is_played_to_its_end(listener, demo_corpus, tmp_path):
    speech = tmp_path / "speech.wav"
    samples = load_voice("embedded").speak("We count the boats on the river.").samples
    soundfile.write(speech, samples, SAMPLE_RATE)
    with running(command("run", f"speech:={speech}")) as process:
        assert process.wait(40) == 0, process.stdout.read()
    times, positions = listener.record.joint_positions()
    robot = load_robot("toa")
    report = motion_report(robot.joints, times, positions, robot.limits)
    assert report.limit_violations == report.joint_jumps == 0
    assert report.max_velocity_rad_s < 1.1 * robot.limits.velocity.max()
    assert report.mean_rate_hz >= 50
    # Sound is best effort, so a listener may miss its end; the motion lasts until then.
    assert times[-1] - times[0] > len(samples) / SAMPLE_RATE
    assert "speech" in {heard.message.source for heard in listener.record.selected}
