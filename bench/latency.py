"""How long text and a sound file take to the bus, stage by stage, and what the graph costs.

`make bench-latency`; the last line is one JSON object.
"""

import json
import tempfile
import time
from pathlib import Path

import psutil
import rclpy
import soundfile
from machine import machine
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import String

from gesture_bot.cli.demo import running_graph
from gesture_bot.cli.latency import stage_latencies
from gesture_bot.corpus.demo import demo_database
from gesture_bot.nodes.node import PLAN
from gesture_bot.nodes.recorder import Record, Recorder
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.voice import load_voice

TEXT = (
    "Hello, I am glad to see you. Today everybody may ask me one big question, "
    "and I will think about it and answer as well as I can."
)


def measure(log: Path, arguments: list[str], text: str | None) -> dict[str, object]:
    """Run the graph for one utterance, listen, and look at its process."""
    rclpy.init()
    recorder = Recorder()
    executor = SingleThreadedExecutor()
    executor.add_node(recorder)
    say = recorder.create_publisher(String, "say", PLAN)
    record = recorder.record
    begin = recorder.now()
    with running_graph(log, *arguments) as graph:
        process = psutil.Process(graph.pid)
        while not _first_motion(record):
            executor.spin_once(timeout_sec=0.05)
        first_motion = _first_motion(record) - begin
        if text:
            while not say.get_subscription_count():
                executor.spin_once(timeout_sec=0.05)
        busy, wall = _cpu_seconds(process), time.monotonic()
        asked = recorder.now()
        if text:
            say.publish(String(data=text))
        while not (
            record.audio and record.audio[-1].message.last and recorder.now() > record.audio[-1].stamp
        ):
            executor.spin_once(timeout_sec=0.05)
        cpu_share = (_cpu_seconds(process) - busy) / (time.monotonic() - wall)
        memory = sum(part.memory_info().rss for part in (process, *process.children(recursive=True)))
    recorder.destroy_node()
    rclpy.shutdown()
    result = {
        "start_to_first_motion_s": round(first_motion, 2),
        "stages_ms": stage_latencies(record),
        "cpu_share_of_one_core": round(cpu_share, 3),
        "memory_mb": round(memory / 2**20),
    }
    if text:
        gesture = next(
            heard for heard in record.selected if heard.stamp > asked and heard.message.source != "rest"
        )
        result["text_to_words_ms"] = round((record.words[0].arrival - asked) * 1e3)
        result["text_to_sound_ms"] = round((record.audio[0].stamp - asked) * 1e3)
        result["text_to_gesture_seen_ms"] = round((gesture.stamp - asked) * 1e3)
    return result


def _first_motion(record: Record) -> float | None:
    if not record.joint_states:
        return None
    start = record.joint_states[0].message.position
    for heard in record.joint_states[-20:]:
        if max(abs(a - b) for a, b in zip(heard.message.position, start, strict=True)) > 0.01:
            return heard.arrival
    return None


def _cpu_seconds(process: psutil.Process) -> float:
    times = [part.cpu_times() for part in (process, *process.children(recursive=True))]
    return sum(t.user + t.system for t in times)


def main() -> None:
    demo_database()
    with tempfile.TemporaryDirectory() as folder:
        wav = Path(folder) / "speech.wav"
        soundfile.write(wav, load_voice("embedded").speak(TEXT).samples, SAMPLE_RATE)
        log = Path(folder) / "graph.log"
        figures = {"text": measure(log, [], TEXT), "wav": measure(log, [f"speech:={wav}"], None)}
    for source, result in figures.items():
        print(f"{source}:")
        for name, value in result.items():
            print(f"  {name}: {value}")
    print(json.dumps({"bench": "latency", **figures, "machine": machine()}))


if __name__ == "__main__":
    main()
