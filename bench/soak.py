"""A long run of the graph: speech on and off, sources switched, sentences cancelled. Does it stay as it was?

`make soak` runs ten minutes; the last line is one JSON object. `--minutes 60` is the long form, `--separate`
starts each node in a process of its own, as `ros2 launch` does, `--busy` gives one core to another program.
"""

import argparse
import os
import signal
import subprocess
import sys
import sysconfig
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import psutil
from long_run import late_trajectories, listening, report, rounds
from rclpy.action import ActionClient

from gesture_bot.action import Speak
from gesture_bot.base.files import config_dir
from gesture_bot.cli.demo import running_graph
from gesture_bot.cli.measured import measured_stroke, planned_joints, robot_wrists
from gesture_bot.evaluate.lag import motion_lag
from gesture_bot.msg import Audio, Constraint, Control, Emotion
from gesture_bot.nodes.graph import NODES
from gesture_bot.nodes.node import STATE, STREAM, stamp
from gesture_bot.nodes.recorder import Recorder
from gesture_bot.retarget.robot import load_robot
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.voice import load_voice

SAID = (
    "Hello, it is good to see you. There are three things that I would like to show you today.",
    "I do not know who has left the door open. Please stop there, and look at me.",
    "Thank you, that was great. I am very happy that the whole world came to see us.",
)
HEARD = "We went along the river with a small boat, and on the other side we found a house that nobody knew."
BLOCK = 512
SLICE = 2.0
"""Length of the pieces of motion whose lag is measured [s]."""

EMOTIONS = ("neutral", "happy", "sad", "angry")


class Soak(Recorder):
    """Plays the user of a long day, a round of about a minute at a time."""

    def __init__(self) -> None:
        super().__init__("soak")
        self._robot = load_robot("toa")
        self._speak = ActionClient(self, Speak, "speak")
        self._emotion = self.create_publisher(Emotion, "emotion", STATE)
        self._control = self.create_publisher(Control, "control", STATE)
        self._audio = self.create_publisher(Audio, "speech/audio", STREAM)
        self._live = load_voice("embedded").speak(HEARD).samples
        self._utterance = 0
        self.strokes: list[float] = []
        self.live_strokes: list[float] = []
        self.lags: list[tuple[float, bool, float]] = []
        self.late_trajectories = 0
        self.keywords = self.cancelled = 0
        self.look_ahead = 0.0

    def round(self, number: int) -> Iterator[None]:
        """Text with keywords, a text that is cancelled, live sound, silence."""
        record = self.record
        self._emotion.publish(Emotion(expression=EMOTIONS[number % len(EMOTIONS)]))
        high = Constraint(quantity="wrist_height", hand="left", value=70.0)
        self._control.publish(Control(constraints=[high] if number % 3 == 2 else []))
        yield from self._say(SAID[number % len(SAID)])
        yield from self._say(SAID[(number + 1) % len(SAID)], cancel_after=2.0)
        begin = self.now()
        yield from self._hear()
        end = self.now()
        yield from self._wait(6.0)
        self._judge((begin, end))
        for kept in vars(record).values():
            del kept[: -1 if kept is record.states else None]

    def ready(self) -> bool:
        """Whether the graph stands."""
        return bool(self.record.joint_states and self.record.refined and self._speak.server_is_ready())

    def _say(self, text: str, cancel_after: float | None = None) -> Iterator[None]:
        sent = self._speak.send_goal_async(Speak.Goal(text=text))
        yield from self._until(sent.done)
        goal = sent.result()
        done = goal.get_result_async()
        if cancel_after is not None:
            yield from self._wait(cancel_after)
            goal.cancel_goal_async()
        yield from self._until(done.done)
        self.cancelled += not done.result().result.spoken

    def _hear(self) -> Iterator[None]:
        """Somebody speaks into a microphone."""
        self._utterance += 1
        begin = self.now()
        for first in range(0, len(self._live), BLOCK):
            block = self._live[first : first + BLOCK]
            yield from self._until(lambda: self.now() >= begin + (first + len(block)) / SAMPLE_RATE)  # noqa: B023
            message = Audio(utterance=self._utterance, sample_rate=SAMPLE_RATE)
            message.header.stamp, message.header.frame_id = stamp(begin + first / SAMPLE_RATE), "microphone"
            message.last = first + BLOCK >= len(self._live)
            message.samples.frombytes(block.tobytes())
            self._audio.publish(message)

    def _judge(self, heard_live: tuple[float, float]) -> None:
        """Take what was measured in a round to the rest."""
        record = self.record
        self.look_ahead = record.states[-1].message.look_ahead
        times, positions = record.joint_positions()
        wrists = robot_wrists(self._robot, positions)
        for heard in record.keywords:
            live = heard.message.header.frame_id == "microphone"
            later = self.look_ahead if live else 0.0
            stroke = measured_stroke(record, heard, times, wrists, later)
            self.keywords += 1
            if stroke is not None:
                (self.live_strokes if live else self.strokes).append(stroke - heard.stamp - later)
        planned_times, planned = planned_joints(record)
        for begin in np.arange(times[0] + 1.0, times[-1] - SLICE - 1.0, SLICE):
            part = (times >= begin) & (times < begin + SLICE)
            if part.sum() > 50:
                lag = motion_lag(times[part], positions[part], planned_times, planned)
                if lag is not None:
                    during = heard_live[0] < begin - self.look_ahead < heard_live[1]
                    self.lags.append((begin, during, lag))
        self.late_trajectories += late_trajectories(record)

    def _wait(self, length: float) -> Iterator[None]:
        end = self.now() + length
        yield from self._until(lambda: self.now() >= end)

    def _until(self, condition: Any) -> Iterator[None]:
        give_up = time.monotonic() + 60.0
        while not condition():
            if time.monotonic() > give_up:
                raise SystemExit("the graph did not answer within 60 s")
            yield


@contextmanager
def separate_graph(log: Path) -> Iterator[list[psutil.Process]]:
    """Each node in a process of its own, as the launch file starts them."""
    folder = Path(sysconfig.get_path("data")) / "lib" / "gesture_bot"
    # The executables look for python3 on the path: it is the one that runs here.
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    settings = ["--ros-args", "--params-file", str(config_dir() / "gesture_bot.yaml")]
    with log.open("wb") as output:
        started = [
            subprocess.Popen(
                [str(folder / node.name), *settings],
                stdout=output,
                stderr=output,
                env={**os.environ, "PATH": path},
            )
            for node in NODES
            if not node.switch
        ]
        try:
            yield [psutil.Process(process.pid) for process in started]
        finally:
            for process in started:
                process.send_signal(signal.SIGINT)
            for process in started:
                process.wait(10)


def memory_of(processes: list[psutil.Process]) -> int:
    """Bytes of RAM that processes and their children hold."""
    family = {child for process in processes for child in (process, *process.children(recursive=True))}
    return sum(process.memory_info().rss for process in family)


def percentile(values: list[float], share: float) -> float | None:
    """In ms; None without values."""
    return round(float(np.percentile(values, share)) * 1e3, 1) if values else None


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--separate", action="store_true")
    parser.add_argument("--busy", action="store_true")
    options = parser.parse_args()
    memory: list[tuple[float, int]] = []
    with listening(Soak) as (soak, executor), ExitStack() as stack:
        log = Path(stack.enter_context(tempfile.TemporaryDirectory())) / "graph.log"
        if options.busy:
            burner = subprocess.Popen([sys.executable, "-c", "while True: pass"])
            stack.callback(burner.kill)
        if options.separate:
            processes = stack.enter_context(separate_graph(log))
        else:
            processes = [psutil.Process(stack.enter_context(running_graph(log)).pid)]
        while not soak.ready():
            executor.spin_once(timeout_sec=0.05)
        begin = time.monotonic()
        for number in rounds("soak", options.minutes):
            for _ in soak.round(number):
                executor.spin_once(timeout_sec=0.01)
            memory.append((time.monotonic() - begin, memory_of(processes)))
        late_windows = soak.record.states[-1].message.late

    settled = next(m for t, m in memory if t > min(300.0, 30 * options.minutes))
    lags = [lag for _, _, lag in soak.lags]
    fifth = max(1, len(lags) // 5)
    live = [soak.look_ahead + lag for _, is_live, lag in soak.lags if is_live]
    result = {
        "memory_growth": round(memory[-1][1] / settled - 1, 4),
        "missed_steps": late_windows + soak.late_trajectories,
        "late_windows": late_windows,
        "drift_ms": round(float(np.median(lags[-fifth:]) - np.median(lags[:fifth])) * 1e3, 1),
        "stroke_to_word_ms_p95": percentile([abs(error) for error in soak.strokes], 95),
        "stroke_to_word_ms_median": percentile(soak.strokes, 50),
        "sound_to_motion_ms_p99": percentile(live, 99),
        "sound_to_motion_ms_median": percentile(live, 50),
        "look_ahead_ms": round(soak.look_ahead * 1e3, 1),
        "lag_ms_median": percentile(lags, 50),
        "lag_ms_p99": percentile(lags, 99),
        "keywords": soak.keywords,
        "strokes_found": len(soak.strokes) + len(soak.live_strokes),
        "live_stroke_to_word_ms_p95": percentile([abs(error) for error in soak.live_strokes], 95),
        "sentences_cancelled": soak.cancelled,
        "memory_mb": round(memory[-1][1] / 2**20),
        "minutes": round(memory[-1][0] / 60, 1),
        "separate": options.separate,
        "busy": options.busy,
    }
    report("soak", result)


if __name__ == "__main__":
    main()
