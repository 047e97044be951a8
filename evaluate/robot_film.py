"""The robot in a video, with its voice."""

import shutil
import subprocess
import tempfile
from contextlib import suppress
from importlib import import_module
from pathlib import Path

import numpy as np
import soundfile
from tqdm import tqdm

from gesture_bot.base.errors import GestureBotError
from gesture_bot.base.files import write_whole
from gesture_bot.evaluate.robot_gif import Scene
from gesture_bot.retarget.robot import Robot

FPS = 30
"""Frames a second."""

_EVEN = "pad=ceil(iw/2)*2:ceil(ih/2)*2"
"""H.264 halves the resolution of colours."""


def write_robot_film(
    path: Path,
    robot: Robot,
    times: np.ndarray,
    positions: np.ndarray,
    begin: float,
    samples: np.ndarray,
    rate: int,
) -> None:
    """Draw a motion of the robot, seen from its front left, as H.264 with AAC sound, as long as the sound.

    Args:
        path: File to write, ending in .mp4.
        robot: The robot.
        times: (n,) increasing moments [s].
        positions: (n, j) joint angles [rad], in the order of `robot.joints`.
        begin: The moment of the first frame and the first sample [s].
        samples: (m,) float32, -1 to 1.
        rate: Samples a second.

    Raises:
        GestureBotError: There is no ffmpeg, or it fails.
        FileFormatError: The file cannot be written.
    """
    ffmpeg = find_ffmpeg()
    moments = begin + np.arange(0.0, len(samples) / rate, 1 / FPS)
    scene = Scene(robot, np.stack([np.interp(moments, times, joint) for joint in positions.T], axis=1))
    first = scene.image(0)
    with write_whole(path) as temporary, tempfile.TemporaryFile() as said:
        sound = temporary.with_suffix(".wav")
        soundfile.write(sound, samples, rate)
        command = [
            ffmpeg, "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24",
            "-s", f"{first.width}x{first.height}", "-r", str(FPS), "-i", "-", "-i", str(sound),
            "-vf", _EVEN, "-pix_fmt", "yuv420p", "-c:a", "aac", "-b:a", "128k", "-movflags", "+faststart",
            str(temporary),
        ]  # fmt: skip
        process = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=said)
        with suppress(BrokenPipeError), process:  # where ffmpeg ends early, it says why
            assert process.stdin
            for i in tqdm(range(len(moments)), desc="video", unit="frame", leave=False, disable=None):
                process.stdin.write(scene.image(i).tobytes())
        if process.wait():
            said.seek(0)
            raise GestureBotError("ffmpeg fails", said.read().decode(errors="replace").strip())


def find_ffmpeg() -> str:
    """The system's ffmpeg, or that of the extra `video`.

    Raises:
        GestureBotError: There is none.
    """
    if found := shutil.which("ffmpeg"):
        return found
    try:
        return str(import_module("imageio_ffmpeg").get_ffmpeg_exe())
    except (ImportError, RuntimeError):
        raise GestureBotError(
            "a video takes ffmpeg: sudo apt install ffmpeg, or pip install 'gesture-bot[video]'"
        ) from None
