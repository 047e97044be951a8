"""Recordings: what other programs read in them, what is left after a crash, and what they are exported to."""

import io
import subprocess
import wave

import numpy as np
import pytest
from mcap.reader import make_reader
from pybvh import read_bvh_file
from rclpy.serialization import serialize_message
from recorded import write_recording
from rosbags.highlevel import AnyReader
from sensor_msgs.msg import JointState

from gesture_bot.base.errors import FileFormatError, InvalidValueError
from gesture_bot.base.frames import FRAME_RATE, KeypointClip
from gesture_bot.base.keypoints import INDEX, KEYPOINTS
from gesture_bot.cli.main import main
from gesture_bot.evaluate.robot_film import FPS, find_ffmpeg
from gesture_bot.msg import Audio, Constraint, Control, Cut
from gesture_bot.nodes.messages import clip_to
from gesture_bot.nodes.node import stamp
from gesture_bot.recording.reader import Recording
from gesture_bot.recording.writer import RecordingWriter
from gesture_bot.retarget.robot import load_robot

BEGIN = 1.7e9
"""On the grid of frames."""

ROBOT = load_robot("toa")
RATE = 16_000
EVENT = BEGIN + 1.2


def control(value):
    high = Constraint(quantity="wrist_height", hand="left", value=value, labels=["a", "b"])
    return Control(constraints=[high])


def states(jump):
    """A robot that rests, and whose left arm is up from one moment on."""
    for moment in np.arange(BEGIN, BEGIN + 2.0, 0.01):
        positions = ROBOT.rest.copy()
        positions[ROBOT.joints.index("left_shoulder_pitch")] += 1.5 * (moment >= jump - 1e-6)
        state = JointState(name=list(ROBOT.joints), position=positions.tolist())
        state.header.stamp = stamp(moment)
        yield "/joint_states", moment, state


def clicks(*moments):
    """Two seconds of silence with clicks, in pieces, as a voice sends them: ahead."""
    samples = np.zeros(2 * RATE, np.float32)
    for moment in moments:
        samples[round((moment - BEGIN) * RATE) :][:160] = 0.8
    for first in range(0, len(samples), 1600):
        audio = Audio(utterance=1, sample_rate=RATE, samples=samples[first : first + 1600].tolist())
        audio.header.frame_id, audio.header.stamp = "voice", stamp(BEGIN + first / RATE)
        yield "/speech/audio", BEGIN + 0.5 * first / RATE, audio


def test_other_programs_find_the_definitions_and_the_messages(tmp_path):
    path = tmp_path / "a.mcap"
    write_recording(path, [("/control", BEGIN, control(80.0)), ("/control", BEGIN + 1.0, control(20.0))])
    with AnyReader([path]) as reader:
        heard = [(t, reader.deserialize(raw, c.msgtype)) for c, t, raw in reader.messages()]
    assert [moment for moment, _ in heard] == [BEGIN * 1e9, (BEGIN + 1) * 1e9]
    assert [message.constraints[0].value for _, message in heard] == [80.0, 20.0]
    assert heard[0][1].constraints[0].labels == ["a", "b"]
    with path.open("rb") as file:
        reader = make_reader(file)
        assert reader.get_header().profile == "ros2"
        schema, channel, _ = next(reader.iter_messages())
    assert (schema.name, schema.encoding, channel.message_encoding) == (
        "gesture_bot/msg/Control",
        "ros2msg",
        "cdr",
    )
    for inner in ("gesture_bot/Constraint", "std_msgs/Header", "builtin_interfaces/Time"):
        assert f"{80 * '='}\nMSG: {inner}\n" in schema.data.decode()


def test_what_is_on_the_disk_survives_a_crash(tmp_path):
    """The file as a killed recorder leaves it, and as a full disk does, in the middle of a chunk."""
    writer = RecordingWriter(tmp_path / "a.mcap")
    channel = writer.add_topic("/control", "gesture_bot/msg/Control", [])
    for second in range(4):
        for _ in range(20):
            moment = round((BEGIN + second) * 1e9)
            writer.write(channel, moment, moment, serialize_message(control(np.random.rand())))
        if second < 3:
            writer.flush()
    killed = (tmp_path / "a.mcap").read_bytes()
    writer.close()
    for cut, left in ((killed, 60), (killed[:-400], 40)):
        (tmp_path / "cut.mcap").write_bytes(cut)
        recording = Recording(tmp_path / "cut.mcap")
        assert recording.cut_off
        assert len(list(recording.messages("/control"))) == left
    assert len(list(Recording(tmp_path / "a.mcap").messages())) == 80
    assert not Recording(tmp_path / "a.mcap").cut_off


def test_a_recording_is_not_lost_by_mistake(tmp_path, capsys):
    path = write_recording(tmp_path / "a.mcap", [("/control", BEGIN, control(80.0))])
    before = path.read_bytes()
    with pytest.raises(InvalidValueError, match="--overwrite"):
        RecordingWriter(path)
    assert path.read_bytes() == before
    RecordingWriter(path, overwrite=True).close()
    with pytest.raises(FileFormatError, match="holds no message"):
        Recording(path)
    path.write_text("no MCAP at all, and longer than its header")
    assert main(["export", str(path), "-o", str(tmp_path / "a.csv")]) == 1
    assert "no MCAP" in capsys.readouterr().err


@pytest.mark.parametrize("damage", [0x01, 0x80, 0xFF])
def test_a_damaged_recording_is_refused(tmp_path, damage):
    """Nothing of it is taken for what the robot did, wherever in the messages the damage is."""
    path = write_recording(tmp_path / "a.mcap", states(EVENT))
    whole = path.read_bytes()
    (chunk,) = make_reader(io.BytesIO(whole)).get_summary().chunk_indexes
    end = chunk.chunk_start_offset + chunk.chunk_length
    for position in np.linspace(end - chunk.compressed_size, end - 1, 20, dtype=int):
        damaged = bytearray(whole)
        damaged[position] ^= damage
        path.write_bytes(damaged)
        with pytest.raises(FileFormatError, match="damaged"):
            list(Recording(path).messages("/joint_states"))


@pytest.mark.parametrize("damage", [0x01, 0x80, 0xFF])
def test_where_the_index_is_damaged_the_messages_are_read_without_it(tmp_path, damage):
    path = write_recording(tmp_path / "a.mcap", states(EVENT))
    whole = path.read_bytes()
    recorded = list(Recording(path).messages())
    (chunk,) = make_reader(io.BytesIO(whole)).get_summary().chunk_indexes
    begin = chunk.chunk_start_offset + chunk.chunk_length + chunk.message_index_length
    for position in range(begin, len(whole) - 8, 3):
        damaged = bytearray(whole)
        damaged[position] ^= damage
        path.write_bytes(damaged)
        found = Recording(path)
        assert list(found.messages()) == recorded, position - begin
        assert found.topics == {"/joint_states": "sensor_msgs/msg/JointState"}


def test_another_version_of_a_message_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "a.mcap"
    monkeypatch.setattr("gesture_bot.recording.writer.type_hash", lambda _: "RIHS01_00")
    write_recording(path, [("/control", BEGIN, control(80.0))])
    with pytest.raises(FileFormatError, match="another version.*gesture_bot/msg/Control"):
        list(Recording(path).messages())


def test_motion_is_exported_as_it_was_seen(tmp_path):
    """The second window replaces the first from its own frame on; both were sent ahead."""
    pose = np.random.default_rng(0).normal(size=(len(KEYPOINTS), 3), scale=0.05).astype(np.float32)
    pose[[INDEX[name] for name in ("spine", "neck", "head", "head_top")], 2] += [0.2, 0.5, 0.6, 0.8]
    windows = []
    for start, height in ((0, 0.0), (10, 0.5)):
        keypoints = np.tile(pose, (15, 1, 1))
        keypoints[..., 2] += height
        clip = KeypointClip(round(BEGIN * FRAME_RATE) + start, keypoints)
        windows.append(("/robot1/gesture/refined", BEGIN + start / FRAME_RATE - 0.3, clip_to(clip, "speech")))
    begin = ("/robot1/joint_states", BEGIN - 0.5, JointState(name=["a"], position=[1.0]))
    end = ("/robot1/joint_states", BEGIN + 2.0, JointState(name=["a"], position=[1.0]))
    path = write_recording(tmp_path / "a.mcap", [begin, *windows, end])
    assert main(["export", str(path), "-o", str(tmp_path / "a.bvh")]) == 0
    motion = read_bvh_file(tmp_path / "a.bvh")
    height = motion.root_pos[:, 1] / 100
    lead = 7  # frames from the recording's begin to that of the first window
    assert len(height) == lead + 2 * FRAME_RATE + 1
    pelvis = pose[INDEX["pelvis"], 2]
    np.testing.assert_allclose(height[: lead + 10], pelvis, atol=1e-4)
    np.testing.assert_allclose(height[lead + 10 :], pelvis + 0.5, atol=1e-4)


def test_sound_that_was_cut_is_not_exported(tmp_path):
    cut = Cut(utterance=1)
    cut.header.frame_id, cut.header.stamp = "voice", stamp(BEGIN + 1.0)
    messages = [*states(EVENT), *clicks(BEGIN + 0.6, EVENT)]
    late = [("/speech/cut", BEGIN + 0.8, cut)]
    for name, sent, heard in (("whole", messages, [0.6, 1.2]), ("cut", messages + late, [0.6])):
        path = write_recording(tmp_path / f"{name}.mcap", sent)
        assert main(["export", str(path), "-o", str(tmp_path / f"{name}.wav")]) == 0
        with wave.open(str(tmp_path / f"{name}.wav")) as file:
            rate, raw = file.getframerate(), file.readframes(file.getnframes())
        loud = np.flatnonzero(np.abs(np.frombuffer(raw, np.int16)) > 8000) / rate
        onsets = loud[np.diff(loud, prepend=-1.0) > 0.1]
        np.testing.assert_allclose(onsets, heard, atol=1e-3)


def test_sound_and_picture_of_the_video_agree(tmp_path):
    path = write_recording(tmp_path / "a.mcap", [*states(EVENT), *clicks(EVENT)])
    assert main(["export", str(path), "-o", str(tmp_path / "a.mp4")]) == 0

    def decoded(*arguments):
        command = [find_ffmpeg(), "-loglevel", "error", "-i", str(tmp_path / "a.mp4"), *arguments, "-"]
        return np.frombuffer(subprocess.run(command, capture_output=True, check=True).stdout, np.uint8)

    frames = decoded("-f", "rawvideo", "-pix_fmt", "gray", "-vf", "scale=120:160").reshape(-1, 160 * 120)
    changed = np.abs(np.diff(frames.astype(int), axis=0)).max(axis=1) > 60
    assert changed.sum() == 1
    seen = (1 + changed.argmax()) / FPS
    sound = decoded("-f", "s16le", "-ac", "1", "-ar", "48000").view(np.int16)
    heard = np.argmax(np.abs(sound.astype(int)) > 8000) / 48_000
    assert seen == pytest.approx(EVENT - BEGIN, abs=1 / FPS)
    assert heard == pytest.approx(EVENT - BEGIN, abs=0.005)
    assert len(frames) / FPS == pytest.approx(len(sound) / 48_000, abs=2 / FPS)
