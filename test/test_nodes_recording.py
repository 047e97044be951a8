"""What is recorded from the topics, what a replay tells the joints, and what RViz is shown."""

import numpy as np
import pytest
import yaml
from conftest import wait_until
from geometry_msgs.msg import Pose, Quaternion
from moving_robot import spun
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from recorded import write_recording
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability, QosReliability
from rosgraph_msgs.msg import Clock
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory as JointTrajectoryMessage
from visualization_msgs.msg import Marker, MarkerArray

from gesture_bot.base.errors import GestureBotError
from gesture_bot.base.files import config_dir
from gesture_bot.base.frames import FRAME_RATE, KeypointClip
from gesture_bot.base.keypoints import BONES, KEYPOINTS
from gesture_bot.base.trajectory import JointTrajectory
from gesture_bot.msg import Audio, Emotion, GestureWindow
from gesture_bot.nodes import player
from gesture_bot.nodes.bag_recorder import BagRecorder
from gesture_bot.nodes.messages import clip_to, trajectory_from, trajectory_to
from gesture_bot.nodes.motion_mux import MotionMux
from gesture_bot.nodes.node import PLAN, STATE, STREAM, seconds, stamp
from gesture_bot.nodes.player import Player
from gesture_bot.nodes.visualizer import BESIDE, Visualizer
from gesture_bot.retarget.kinematics import Kinematics
from gesture_bot.retarget.link_frames import LinkFrames
from gesture_bot.retarget.robot import load_robot
from gesture_bot.servo import mux
from gesture_bot.servo.arbitration import load_arbitration

pytestmark = pytest.mark.live

ROBOT = load_robot("toa")


def test_what_passes_is_recorded_from_its_first_message_on(listener, tmp_path):
    """A latched message is older than the recorder; `say` has no publisher yet, only somebody who listens."""
    emotion = listener.create_publisher(Emotion, "emotion", STATE)
    emotion.publish(Emotion(expression="happy"))
    audio = listener.create_publisher(Audio, "speech/audio", STREAM)
    listener.create_subscription(String, "say", lambda _: None, PLAN)
    recorder = BagRecorder(tmp_path / "a.mcap", context=listener.context)

    def found():
        recorder.look_around()
        return audio.get_subscription_count() == 2  # the listener listens, too

    wait_until(found, 10, "the recorder to find the topics")
    say = listener.create_publisher(String, "say", PLAN)
    wait_until(lambda: say.get_subscription_count() == 2, 10, "the recorder on say")
    say.publish(String(data="Hello"))
    begin = listener.now()
    for number in range(50):
        audio.publish(Audio(utterance=number, sample_rate=16_000, samples=[0.5] * 1600))

    def recorded():
        recorder.drain()
        return recorder.messages >= 52

    wait_until(recorded, 10, "all messages")
    recorder.destroy_node()
    with AnyReader([tmp_path / "a.mcap"]) as reader:
        heard = {}
        for connection, arrival, raw in reader.messages():
            heard.setdefault(connection.topic, []).append(
                (arrival, reader.deserialize(raw, connection.msgtype))
            )
        offered = {c.topic: c.ext.offered_qos_profiles for c in reader.connections}
    assert [message.expression for _, message in heard["/emotion"]] == ["happy"]
    assert [message.data for _, message in heard["/say"]] == ["Hello"]
    assert [message.utterance for _, message in heard["/speech/audio"]] == list(range(50))
    assert heard["/speech/audio"][7][1].samples.tolist() == [0.5] * 1600
    assert 0 <= heard["/speech/audio"][0][0] * 1e-9 - begin < 5
    assert offered["/emotion"][0].durability == QosDurability.TRANSIENT_LOCAL
    assert offered["/speech/audio"][0].reliability == QosReliability.BEST_EFFORT


def session(begin):
    """What a mux sends in two seconds: gestures, an operator who takes an elbow and gives it back, a stop."""
    sources, _ = load_arbitration("shipped")
    box = mux.MotionMux(ROBOT.limits, ROBOT.rest, sources)
    middle = 0.5 * (ROBOT.limits.lower + ROBOT.limits.upper)
    shares = 0.15 * (ROBOT.limits.upper - ROBOT.limits.lower)
    phases = 4.0 * np.arange(len(ROBOT.joints))
    for step in range(55):
        now = begin + 0.04 * step
        if step % 13 == 0:
            times = now + 0.1 + np.arange(0.0, 1.0, 0.02)
            angles = 5.0 * (times[:, None] - begin) + phases
            plan = JointTrajectory(
                ROBOT.joints, times, middle + shares * np.sin(angles), 5.0 * shares * np.cos(angles)
            )
            box.set_source("gesture", plan, now)
        if 10 < step < 20:
            taken = np.full((1, 1), middle[ROBOT.joints.index("left_elbow")])
            box.set_source("teleop", JointTrajectory(("left_elbow",), np.array([now]), taken, 0 * taken), now)
        if step == 45:
            box.stop()
        yield now + 1e-3, box.tick(now)


def test_a_replay_tells_the_joints_what_they_were_told(listener, tmp_path, monkeypatch):
    """In simulated time, which goes on when the mux has spoken."""
    monkeypatch.setattr(player, "DISCOVERY", 0.3)
    monkeypatch.setattr(player, "APPROACH", 1.0)
    then = list(session(1.7e9 + 0.123))
    messages = [("/joint_trajectory", arrival, trajectory_to(command)) for arrival, command in then]
    path = write_recording(tmp_path / "a.mcap", messages)
    simulated = Parameter("use_sim_time", value=True)
    options = {"context": listener.context, "parameter_overrides": [simulated]}
    options["parameter_overrides"].append(Parameter("recording", value=str(path)))
    clock = listener.create_publisher(Clock, "/clock", PLAN)
    now = []
    listener.create_subscription(
        JointTrajectoryMessage, "joint_trajectory", lambda m: now.append(trajectory_from(m, 0.0)), PLAN
    )
    nodes = [Player(**options), MotionMux(context=listener.context, parameter_overrides=[simulated])]
    executor = SingleThreadedExecutor(context=listener.context)
    for node in nodes:
        executor.add_node(node)
    wait_until(lambda: clock.get_subscription_count() == 2, 20, "the nodes to hear the clock")

    def spoken(moment):
        clock.publish(Clock(clock=stamp(moment)))
        executor.spin_once(timeout_sec=0.01)
        return now and now[-1].times[0] > moment - 1e-3

    moment, end = 1.8e9, np.inf
    while moment < end:
        moment += 0.05
        wait_until(lambda: spoken(moment), 20, "the mux")  # noqa: B023
        if listener.record.trajectories:
            shift = listener.record.trajectories[0].stamp - then[0][1].times[0]
            end = then[-1][1].times[0] + shift
        assert moment < 1.8e9 + 60, "the replay should have begun"
    with pytest.raises(GestureBotError, match="running already"):
        Player("second", **options)
    executor.shutdown()
    for node in nodes:
        node.destroy_node()
    assert shift == pytest.approx(round(shift), abs=1e-6)

    begins = np.array([command.times[0] for _, command in then])
    moved = []
    for command in now:
        moment = command.times[0] - shift
        if begins[0] <= moment <= begins[-1]:
            latest = then[np.searchsorted(begins, moment, side="right") - 1][1]
            moved.append((command.positions[0], latest.at(moment)[0]))
    assert len(moved) > 25
    replayed, recorded = np.array(moved).swapaxes(0, 1)
    assert (np.ptp(recorded, axis=0) > 0.2).sum() >= 8
    # Within a step of the servos. Mostly it is a hundredth of that; where a stop begins between two commands,
    # the cubic from one to the next brakes a little earlier.
    np.testing.assert_allclose(replayed, recorded, atol=2 * np.pi / 4096)


def test_keypoints_are_drawn_while_somebody_looks(listener):
    visualizer = Visualizer(context=listener.context)
    windows = listener.create_publisher(GestureWindow, "gesture/refined", PLAN)
    drawn, described = [], []
    with spun(listener.context, [visualizer]):
        listener.create_subscription(String, "robot_description", lambda m: described.append(m.data), STATE)
        wait_until(lambda: described == [ROBOT.urdf], 10, "the description")
        idle = windows.get_subscription_count()
        listener.create_subscription(MarkerArray, "gesture/markers", lambda m: drawn.append(m.markers), PLAN)
        wait_until(lambda: windows.get_subscription_count() == idle + 1, 10, "the visualizer to look")
        start = round(listener.now() * FRAME_RATE)
        keypoints = np.random.default_rng(0).normal(size=(60, len(KEYPOINTS), 3)).astype(np.float32)
        windows.publish(clip_to(KeypointClip(start, keypoints), "speech"))
        wait_until(lambda: len(drawn) > 3, 10, "markers")
    lines, spheres = drawn[-1]
    assert (lines.type, spheres.type) == (Marker.LINE_LIST, Marker.SPHERE_LIST)
    assert {lines.ns, spheres.ns} == {"gesture/refined"}
    assert lines.header.frame_id == spheres.header.frame_id == "base_link"
    assert lines.pose == spheres.pose == Pose(position=BESIDE, orientation=Quaternion(w=1.0))
    seen = keypoints[round(seconds(lines.header.stamp) * FRAME_RATE) - start]
    np.testing.assert_allclose([[p.x, p.y, p.z] for p in spheres.points], seen, atol=1e-6)
    ends = np.array([[p.x, p.y, p.z] for p in lines.points]).reshape(-1, 2, 3)
    np.testing.assert_allclose(ends, seen[np.array(BONES)], atol=1e-6)


def test_transforms_lead_from_the_base_to_each_link(listener):
    visualizer = Visualizer(context=listener.context, namespace="robot1")
    angles = 0.7 * ROBOT.limits.lower + 0.3 * ROBOT.limits.upper
    state = JointState(name=list(ROBOT.joints), position=angles.tolist())
    transforms = {
        transform.child_frame_id: transform
        for transform in (*visualizer.fixed_transforms(), *visualizer.moving_transforms(state))
    }
    visualizer.destroy_node()
    kinematics = Kinematics(ROBOT)
    kinematics.place(angles)
    for link in ROBOT.mapping.links():
        frame, position, rotation = f"robot1/{link}", np.zeros(3), Rotation.identity()
        while frame in transforms:
            step = transforms[frame].transform
            turn = Rotation.from_quat([step.rotation.x, step.rotation.y, step.rotation.z, step.rotation.w])
            place = [step.translation.x, step.translation.y, step.translation.z]
            position, rotation = turn.apply(position) + place, turn * rotation
            frame = transforms[frame].header.frame_id
        assert frame == "robot1/base_link"
        np.testing.assert_allclose(position, kinematics.position(link), atol=1e-9)
        np.testing.assert_allclose(rotation.as_matrix(), kinematics.rotation(link), atol=1e-9)


def test_rviz_is_told_what_the_visualizer_publishes():
    shown = yaml.safe_load((config_dir() / "gesture_bot.rviz").read_text())["Visualization Manager"]
    topics = {
        settings["Value"]
        for display in shown["Displays"]
        for name, settings in display.items()
        if name.endswith("Topic")
    }
    assert topics == {"robot_description", "gesture/markers"}
    assert shown["Global Options"]["Fixed Frame"] == LinkFrames(ROBOT).base
