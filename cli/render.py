"""The graph's motion for a sound file, without ROS and without waiting for the clock."""

import argparse
from collections.abc import Sequence

import numpy as np
from tqdm import tqdm

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.frames import FRAME_RATE, frame_time
from gesture_bot.base.trajectory import JointTrajectory
from gesture_bot.corpus.demo import load_database
from gesture_bot.evaluate.motion_files import write_bvh, write_joint_csv
from gesture_bot.evaluate.robot_gif import write_robot_gif
from gesture_bot.matching.banks import load_banks
from gesture_bot.matching.emotions import load_emotions
from gesture_bot.matching.selector import Selector
from gesture_bot.refine.model import RefinementModel, load_model
from gesture_bot.refine.offline import LEAD_IN, refined_windows
from gesture_bot.retarget.retargeter import Retargeter
from gesture_bot.retarget.robot import load_robot
from gesture_bot.speech.audio import load_audio
from gesture_bot.speech.streaming import SpeechFrame, speech_frames

FORMATS = (".bvh", ".csv", ".gif")

LEAD_OUT = FRAME_RATE
"""Frames after the sound, for the last retraction."""


def command(options: argparse.Namespace) -> int:
    """`gesture-bot render`: write the motion for a sound file; the exit status.

    Args:
        options: speech, the sound file; output, .bvh (the human skeleton, 15 frames a second), .csv (joint
            angles [rad], 50 a second) or .gif; database, a file or "demo"; emotion, a name of
            config/emotions.yaml; robot, of config/robots or a YAML file; model, as for
            model.load_model; seed of everything drawn at random.

    Raises:
        GestureBotError: A file, name or format that is not valid.
    """
    output = options.output
    if output.suffix not in FORMATS:
        raise InvalidValueError("cannot render to this kind of file", output.name, FORMATS)
    samples = load_audio(options.speech)
    robot = load_robot(options.robot)
    database = load_database(options.database)
    model = load_model(options.model, database)
    selector = Selector(
        database,
        emotions=load_emotions(),
        gestures=load_banks(),
        seed=options.seed,
    )
    selector.set_emotion(options.emotion)
    keypoints, trajectory = motion(speech_frames(samples), selector, Retargeter(robot), model)
    if output.suffix == ".bvh":
        write_bvh(output, keypoints, FRAME_RATE)
    elif output.suffix == ".csv":
        write_joint_csv(output, trajectory.joints, trajectory.times, trajectory.positions)
    else:
        write_robot_gif(output, robot, trajectory.times, trajectory.positions)
    print(f"wrote {output}: {len(keypoints) / FRAME_RATE:.1f} s of motion")
    return 0


def motion(
    speech: Sequence[SpeechFrame],
    selector: Selector,
    retargeter: Retargeter,
    model: RefinementModel | None = None,
) -> tuple[np.ndarray, JointTrajectory]:
    """Walk speech through search, refinement and retargeting, as the nodes do.

    Args:
        speech: Its frames; see speech/streaming.py.
        selector: Chooses windows; fresh.
        retargeter: Of the robot; fresh.
        model: The network that refines; without one, windows are smoothed.

    Returns:
        (m, 17, 3) refined keypoints [m] from the first frame of the sound, and the joint trajectory, every
        20 ms, its times counted from there [s].
    """
    stop = LEAD_IN + len(speech) + LEAD_OUT
    frames: dict[int, np.ndarray] = {}
    points: dict[int, tuple[np.ndarray, np.ndarray]] = {}
    progress = tqdm(range(stop), desc="gestures", unit="frame", leave=False, disable=None)
    for _, clip in refined_windows(selector, speech, progress, model):
        frames.update(enumerate(clip.keypoints, clip.start))
        plan = retargeter.push(clip)
        ticks = np.rint(plan.times * 50).astype(int)
        points.update(zip(ticks, zip(plan.positions, plan.velocities, strict=True), strict=True))
    first, last = round(frame_time(LEAD_IN) * 50), round(frame_time(stop) * 50)
    positions, velocities = zip(*(points[tick] for tick in range(first, last)), strict=True)
    return (
        np.stack([frames[frame] for frame in range(LEAD_IN, stop)]),
        JointTrajectory(plan.joints, np.arange(last - first) / 50, np.stack(positions), np.stack(velocities)),
    )
