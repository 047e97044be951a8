"""What the demo leaves behind: sound, measured joints, a summary, a timeline and a film."""

import json
from collections.abc import Callable, Iterable
from dataclasses import asdict
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import soundfile

from gesture_bot.base.files import write_whole
from gesture_bot.base.frames import FRAME_RATE
from gesture_bot.base.keypoints import INDEX
from gesture_bot.cli.latency import stage_latencies
from gesture_bot.cli.measured import deadline_misses, measured_stroke, robot_wrists
from gesture_bot.cli.words import constraint_in_words
from gesture_bot.evaluate.motion_files import write_joint_csv
from gesture_bot.evaluate.motion_report import motion_report
from gesture_bot.evaluate.robot_gif import write_robot_gif
from gesture_bot.evaluate.timeline import Span, Timeline, WristHeights, write_timeline
from gesture_bot.nodes.messages import clip_from
from gesture_bot.nodes.node import seconds
from gesture_bot.nodes.recorder import Heard, Record
from gesture_bot.retarget.robot import Robot


def write_demo_files(folder: Path, record: Record, robot: Robot) -> dict[str, Any]:
    """Write speech.wav, joint_states.csv, summary.json, timeline.png and gesture.gif.

    Args:
        folder: Where to.
        record: What the demo heard.
        robot: The robot that moved.

    Returns:
        What summary.json holds.
    """
    begin = record.audio[0].stamp
    times, positions = record.joint_positions()
    wrists = robot_wrists(robot, positions)
    samples, rate = _speech(record)
    summary = _summary(record, robot, times, positions, wrists)

    with write_whole(folder / "speech.wav") as temporary:
        soundfile.write(temporary, samples, rate, format="WAV")
    write_joint_csv(folder / "joint_states.csv", robot.joints, times - begin, positions)
    with write_whole(folder / "summary.json") as temporary:
        temporary.write_text(json.dumps(summary, indent=2) + "\n")
    keywords = summary["keywords"]
    write_timeline(
        folder / "timeline.png",
        Timeline(
            samples=samples,
            sample_rate=rate,
            start=begin,
            words=tuple(Span(h.stamp, h.stamp + h.message.duration, h.message.text) for h in record.words),
            keywords=tuple(_keyword_span(h) for h in record.keywords),
            strokes=tuple(begin + k["stroke_time"] for k in keywords if k["stroke_time"] is not None),
            windows=tuple(_windows(record, times[-1])),
            planned=_planned_wrists(record),
            moved=WristHeights(times, wrists["left"][:, 2], wrists["right"][:, 2]),
            emotions=tuple(_states(record.states, times[-1], lambda state: [state.expression])),
            controls=tuple(
                _states(record.states, times[-1], lambda state: map(constraint_in_words, state.constraints))
            ),
            teleop=tuple(_states(record.owners, times[-1], _taken)),
        ),
    )
    spoken = times >= begin - 1.0
    write_robot_gif(
        folder / "gesture.gif",
        robot,
        times[spoken],
        positions[spoken],
        captions=_captions(record, times[spoken]),
    )
    return summary


def _summary(
    record: Record, robot: Robot, times: np.ndarray, positions: np.ndarray, wrists: dict[str, np.ndarray]
) -> dict[str, Any]:
    report = motion_report(robot.joints, times, positions, robot.limits)
    return {
        "duration_s": round(times[-1] - times[0], 2),
        "frames_selected": sum(
            len(clip_from(h.message).keypoints) for h in record.selected if h.message.source != "rest"
        ),
        "keywords": [_keyword(record, heard, times, wrists) for heard in record.keywords],
        "emotion_changes": _changes(heard.message.expression for heard in record.states),
        "teleop_takeovers": sum(
            "teleop" not in before.message.owners and "teleop" in after.message.owners
            for before, after in pairwise(record.owners)
        ),
        **{name: round(value, 3) for name, value in asdict(report).items()},
        "deadline_misses": deadline_misses(record),
        "latency_ms": stage_latencies(record),
    }


def _keyword(
    record: Record, heard: Heard, times: np.ndarray, wrists: dict[str, np.ndarray]
) -> dict[str, Any]:
    """A keyword, when its stroke was due, and when the robot's hands made it, if they did."""
    measured = measured_stroke(record, heard, times, wrists)
    begin = record.audio[0].stamp
    return {
        "word": heard.message.phrase,
        "gesture": heard.message.gesture,
        "word_time": round(heard.stamp - begin, 3),
        "stroke_time": None if measured is None else round(measured - begin, 3),
    }


def _changes(values: Iterable[Any]) -> int:
    return sum(before != after for before, after in pairwise(values))


def _planned_wrists(record: Record) -> WristHeights:
    frames: dict[int, np.ndarray] = {}
    for heard in record.refined:
        clip = clip_from(heard.message)
        frames.update(enumerate(clip.keypoints, clip.start))
    order = sorted(frames)
    heights = np.array([frames[frame][:, 2] for frame in order])
    return WristHeights(
        np.array(order) / FRAME_RATE, heights[:, INDEX["left_wrist"]], heights[:, INDEX["right_wrist"]]
    )


def _speech(record: Record) -> tuple[np.ndarray, int]:
    """All that was said, with its pauses, from the first sound on."""
    rate, begin = record.audio[0].message.sample_rate, record.audio[0].stamp
    ends = [round((h.stamp - begin) * rate) + len(h.message.samples) for h in record.audio]
    samples = np.zeros(max(ends), np.float32)
    for heard, end in zip(record.audio, ends, strict=True):
        samples[end - len(heard.message.samples) : end] = heard.message.samples
    return samples, rate


def _keyword_span(heard: Heard) -> Span:
    start = seconds(heard.message.begin)
    return Span(start, start + heard.message.duration, heard.message.gesture)


def _windows(record: Record, end: float) -> Iterable[Span]:
    """Windows as they were seen: each lasts until the next one begins."""
    seen: list[Heard] = []
    for heard in record.selected:
        while seen and seen[-1].stamp >= heard.stamp:
            seen.pop()
        seen.append(heard)
    for heard, following in zip(seen, [h.stamp for h in seen[1:]] + [end], strict=True):
        window = heard.message
        label = window.name or (str(window.sequence) if window.sequence >= 0 else "")
        yield Span(heard.stamp, following, label, window.source)


def _states(states: list[Heard], end: float, labels: Callable[[Any], Iterable[str]]) -> Iterable[Span]:
    """A span for every label, from the state that brings it to the one that no longer has it."""
    since: dict[str, float] = {}
    for heard in states:
        current = set(labels(heard.message))
        for gone in since.keys() - current:
            yield Span(since.pop(gone), heard.stamp, gone)
        for label in current:
            since.setdefault(label, heard.stamp)
    for label, start in since.items():
        yield Span(start, end, label)


def _taken(owners: Any) -> list[str]:
    taken = [joint for joint, owner in zip(owners.joints, owners.owners, strict=True) if owner == "teleop"]
    return [f"operator: {len(taken)} joints"] if taken else []


def _captions(record: Record, times: np.ndarray) -> list[str]:
    """What is said, felt and who moves the robot, at each moment."""

    def latest(kept: list[Heard]) -> Callable[[float], Any]:
        stamps = np.array([heard.stamp for heard in kept])
        return lambda moment: kept[max(0, int(np.searchsorted(stamps, moment, side="right")) - 1)].message

    state, owners = latest(record.states), latest(record.owners)
    word_times = [heard.stamp for heard in record.words]
    captions = []
    for moment in times:
        first = int(np.searchsorted(word_times, moment, side="right")) - 1
        spoken = " ".join(
            heard.message.text
            for heard in record.words[max(0, first - 3) : first + 1]
            if moment - heard.stamp < 2.5
        )
        parts = [
            state(moment).expression,
            *map(constraint_in_words, state(moment).constraints),
            *_taken(owners(moment)),
        ]
        captions.append(f"{' · '.join(parts)}   {spoken}")
    return captions
