"""What the studio costs with a page open and everything moving, and whether the graph misses anything.

`make bench-studio`; the last line is one JSON object. It needs chromium, whose work is not counted. That runs
at the lowest priority: without a graphics card it takes more of a small machine than all the rest.
"""

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import psutil
from long_run import late_trajectories, listening, report, rounds
from std_msgs.msg import String

from gesture_bot.cli.demo import running_graph, studio_address
from gesture_bot.msg import Emotion
from gesture_bot.nodes.demo_director import SCRIPT
from gesture_bot.nodes.node import PLAN, STATE
from gesture_bot.nodes.recorder import Recorder

sys.path.insert(0, str(Path(__file__).parents[1] / "test"))
from browser import element, open_pages  # noqa: E402


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--closed", action="store_true", help="without a page")
    options = parser.parse_args()
    with listening(Recorder) as (recorder, executor), ExitStack() as stack:
        say = recorder.create_publisher(String, "say", PLAN)
        emotion = recorder.create_publisher(Emotion, "emotion", STATE)
        record = recorder.record

        def until(condition: Callable[[], object]) -> None:
            give_up = time.monotonic() + 180.0
            while not condition():
                executor.spin_once(timeout_sec=0.02)
                if time.monotonic() > give_up:
                    raise SystemExit("the graph did not answer within 180 s")

        log = Path(stack.enter_context(tempfile.TemporaryDirectory())) / "graph.log"
        graph = stack.enter_context(running_graph(log, "studio:=true", "studio_address:=127.0.0.1:0"))
        until(lambda: studio_address(log) and record.refined)
        (studio,) = [child for child in psutil.Process(graph.pid).children() if "studio" in child.cmdline()]
        os.nice(19)  # what starts from here on is the browser
        pages = [] if options.closed else stack.enter_context(open_pages(studio_address(log)))
        for page in pages:
            for switch in ("chosen pose", "refined pose", "robot's target"):
                element(page, switch).click()

        memory: list[tuple[float, int]] = []
        late_before, begin, busy = record.states[-1].message.late, time.monotonic(), cpu_seconds(studio)
        trajectories = 0
        for number in rounds("studio", options.minutes):
            feeling, _, text = SCRIPT[number % len(SCRIPT)]
            spoken = sum(heard.message.last for heard in record.audio)
            emotion.publish(Emotion(expression=feeling))
            say.publish(String(data=text))
            until(lambda spoken=spoken: sum(heard.message.last for heard in record.audio) > spoken)
            until(lambda: recorder.now() > record.audio[-1].stamp)
            for page in pages:
                page.wait_for_timeout(1)  # reads what the browser tells
            memory.append((time.monotonic() - begin, studio.memory_info().rss))
            trajectories += late_trajectories(record)
            for kept in (record.trajectories, record.joint_states, record.diagnostics):
                kept.clear()
        share = (cpu_seconds(studio) - busy) / (time.monotonic() - begin)
        late_windows = record.states[-1].message.late - late_before

    settled = next(size for at, size in memory if at >= min(60.0, 15 * options.minutes))
    result = {
        "cpu_share": round(share, 4),
        "memory_growth": round(memory[-1][1] / settled - 1, 4),
        "missed_steps": late_windows + trajectories,
        "late_windows": late_windows,
        "memory_mb": round(memory[-1][1] / 2**20),
        "minutes": round(memory[-1][0] / 60, 1),
        "page_open": not options.closed,
    }
    report("studio", result)


def cpu_seconds(process: psutil.Process) -> float:
    """Processor time that a process has taken."""
    times = process.cpu_times()
    return times.user + times.system


if __name__ == "__main__":
    main()
