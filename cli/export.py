"""`gesture-bot export`: a recording in files that other tools read."""

import argparse
from collections.abc import Iterator
from typing import Any

import numpy as np
import soundfile
from rclpy.serialization import deserialize_message
from tqdm import tqdm

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.files import write_whole
from gesture_bot.base.frames import FRAME_RATE, first_frame_after, frame_time
from gesture_bot.evaluate.motion_files import write_bvh, write_joint_csv
from gesture_bot.evaluate.robot_film import find_ffmpeg, write_robot_film
from gesture_bot.evaluate.soundtrack import Soundtrack
from gesture_bot.nodes.messages import clip_from
from gesture_bot.nodes.node import seconds
from gesture_bot.recording.definitions import message_class
from gesture_bot.recording.reader import Recording
from gesture_bot.retarget.robot import load_robot

FORMATS = (".bvh", ".csv", ".wav", ".mp4")

SOUND_RATE = 48_000
"""Of WAV and video [Hz]."""


def command(options: argparse.Namespace) -> int:
    """`gesture-bot export`: write a recording as BVH, CSV, WAV or MP4; the exit status.

    All begin at the first frame of the 15 Hz grid in the recording, and end with it.

    Args:
        options: recording, the MCAP file; output, .bvh (the human skeleton, 15 frames a second), .csv
            (measured joint angles [rad]), .wav or .mp4 (the robot, with sound); robot, of the video.

    Raises:
        GestureBotError: A file, name or format that is not valid, or no ffmpeg for a video.
    """
    output = options.output
    if output.suffix not in FORMATS:
        raise InvalidValueError("cannot export to this kind of file", output.name, FORMATS)
    if output.suffix == ".mp4":
        find_ffmpeg()  # before all else
    recording = Recording(options.recording)
    if recording.cut_off:
        print(f"{options.recording} was not closed: its end is missing")
    first = first_frame_after(recording.begin * 1e-9)
    begin, duration = frame_time(first), recording.end * 1e-9 - frame_time(first)
    if output.suffix == ".bvh":
        write_bvh(output, _keypoints(recording, first, int(duration * FRAME_RATE) + 1), FRAME_RATE)
    elif output.suffix == ".csv":
        joints, times, positions = _joints(recording)
        seen = times >= begin
        write_joint_csv(output, joints, times[seen] - begin, positions[seen])
    elif output.suffix == ".wav":
        with write_whole(output) as temporary:
            soundfile.write(temporary, _sound(recording, begin, duration), SOUND_RATE)
    else:
        robot = load_robot(options.robot)
        joints, times, positions = _joints(recording)
        if set(joints) != set(robot.joints):
            raise InvalidValueError(f"the recorded robot has other joints than --robot {robot.name}", joints)
        columns = [joints.index(joint) for joint in robot.joints]
        silence = np.zeros(round(duration * SOUND_RATE), np.float32)
        heard = recording.topic("speech/audio") in recording.topics
        sound = _sound(recording, begin, duration) if heard else silence
        write_robot_film(output, robot, times, positions[:, columns], begin, sound, SOUND_RATE)
    print(f"wrote {output}: {duration:.1f} s")
    return 0


def _messages(recording: Recording, *names: str) -> Iterator[Any]:
    """The messages of some of the graph's topics.

    Raises:
        InvalidValueError: The recording has none of the first one.
    """
    topics = [recording.topic(name) for name in names]
    if topics[0] not in recording.topics:
        raise InvalidValueError("the recording lacks the topic", topics[0], recording.topics)
    for recorded in tqdm(recording.messages(*topics), desc="reading", leave=False, disable=None):
        yield deserialize_message(recorded.data, message_class(recorded.type_name))


def _joints(recording: Recording) -> tuple[list[str], np.ndarray, np.ndarray]:
    """Names, (n,) moments [s since the epoch] and (n, j) measured positions [rad]."""
    names: list[str] = []
    times, positions = [], []
    for state in _messages(recording, "joint_states"):
        names = names or state.name
        if state.name == names:
            times.append(seconds(state.header.stamp))
            positions.append(state.position)
    return names, np.array(times), np.array(positions)


def _keypoints(recording: Recording, first: int, count: int) -> np.ndarray:
    """(count, 17, 3) keypoints as they were seen; where nothing was planned, the last ones stay."""
    frames: dict[int, np.ndarray] = {}
    stop = first
    for message in _messages(recording, "gesture/refined"):
        clip = clip_from(message)
        for dropped in range(clip.start, stop):
            frames.pop(dropped, None)
        stop = clip.stop
        frames.update(enumerate(clip.keypoints, clip.start))
    known = np.array(sorted(frames))
    last = np.searchsorted(known, np.arange(first, first + count), side="right") - 1
    return np.stack([frames[frame] for frame in known[np.maximum(last, 0)]])


def _sound(recording: Recording, begin: float, duration: float) -> np.ndarray:
    """(n,) what was heard."""
    track = Soundtrack()
    for message in _messages(recording, "speech/audio", "speech/cut"):
        source, moment = message.header.frame_id, seconds(message.header.stamp)
        if hasattr(message, "samples"):
            samples = np.asarray(message.samples, np.float32)
            track.put(source, message.utterance, moment, samples, message.sample_rate)
        else:
            track.cut(source, message.utterance, moment)
    return track.mix(begin, duration, SOUND_RATE)
