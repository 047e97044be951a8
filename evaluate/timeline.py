"""A run in one picture: what was said, which windows were chosen, and how the hands moved."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from gesture_bot.base.files import write_whole

_ROW = 15.0
"""Seconds in a row of the picture."""

_SOURCES = {"speech": "#9dc3e6", "rest": "#e1e5ea", "bank": "#f4b860"}
_LEFT, _RIGHT = "#1f6fb2", "#d1495b"
_WAVE, _KEYWORD = "#8a94a0", "#b34700"
_EMOTION, _CONTROL, _TELEOP = "#b5dcc3", "#f3d9b1", "#cdbce8"
_SPEECH, _WINDOWS, _PLANNED, _MOVED, _STATE = range(5)


@dataclass(frozen=True)
class Span:
    """Something that lasts.

    Attributes:
        start: [s since the epoch].
        end: [s since the epoch].
        label: What is written in it.
        source: Of a window: `speech`, `rest` or `bank`.
    """

    start: float
    end: float
    label: str
    source: str = ""


@dataclass(frozen=True)
class WristHeights:
    """Heights of both wrists over the pelvis or the robot's base.

    Attributes:
        times: (n,) increasing moments [s since the epoch].
        left: (n,) [m].
        right: (n,) [m].
    """

    times: np.ndarray
    left: np.ndarray
    right: np.ndarray


@dataclass(frozen=True)
class Timeline:
    """All that happened in a run.

    Attributes:
        samples: (n,) what was heard, from -1 to 1.
        sample_rate: Samples a second.
        start: When its first sample was heard [s since the epoch].
        words: The words said.
        keywords: Those of them that have a gesture.
        strokes: When the strokes of keyword gestures were made [s since the epoch].
        windows: The windows chosen, labelled with the name of the gesture or of the recording.
        planned: Wrists of the refined keypoints.
        moved: Wrists of the robot.
        emotions: Emotions in force.
        controls: Controls in force; they may overlap.
        teleop: When an operator had the robot, labelled with what they held.
    """

    samples: np.ndarray
    sample_rate: int
    start: float
    words: tuple[Span, ...]
    keywords: tuple[Span, ...]
    strokes: tuple[float, ...]
    windows: tuple[Span, ...]
    planned: WristHeights
    moved: WristHeights
    emotions: tuple[Span, ...]
    controls: tuple[Span, ...]
    teleop: tuple[Span, ...]


def write_timeline(path: Path, timeline: Timeline) -> None:
    """Draw a run on one time axis, which counts from the first sample and breaks into rows of 15 s.

    Args:
        path: File to write, ending in .png.
        timeline: The run.
    """
    ends = [timeline.start + len(timeline.samples) / timeline.sample_rate]
    ends += [wrists.times[-1] for wrists in (timeline.planned, timeline.moved) if len(wrists.times)]
    rows = max(1, int(np.ceil((max(ends) - timeline.start) / _ROW)))
    figure = Figure(figsize=(20, 5 * rows + 0.6), dpi=80, layout="constrained")
    figure.legend(handles=_legend(), loc="outside upper center", ncols=9, frameon=False)
    for row, part in enumerate(figure.subfigures(rows, 1, squeeze=False)[:, 0]):
        axes = part.subplots(5, 1, sharex=True, height_ratios=[1.5, 0.3, 1, 1, 0.9])
        axes[0].set_xlim(row * _ROW, (row + 1) * _ROW)
        _draw_speech(axes[_SPEECH], timeline)
        _draw_spans(axes[_WINDOWS], [("window", timeline.windows, "")], timeline.start)
        _draw_wrists(axes[_PLANNED], timeline.planned, "wrists over\npelvis [m]", timeline.start)
        _draw_wrists(axes[_MOVED], timeline.moved, "robot's wrists\nover base [m]", timeline.start)
        _draw_spans(axes[_STATE], _lanes(timeline), timeline.start)
        for stroke in timeline.strokes:
            for panel in (_SPEECH, _PLANNED, _MOVED):
                axes[panel].axvline(stroke - timeline.start, color=_KEYWORD, linestyle=":", linewidth=1.5)
        axes[-1].set_xlabel("time [s]")
    with write_whole(path) as temporary:
        figure.savefig(temporary)


def _draw_speech(axes: Axes, timeline: Timeline) -> None:
    bins = np.array_split(timeline.samples, max(1, int(100 * len(timeline.samples) / timeline.sample_rate)))
    loudest = max(1e-3, float(np.abs(timeline.samples).max(initial=0)))
    high = np.array([part.max(initial=0) for part in bins]) / loudest
    low = np.array([part.min(initial=0) for part in bins]) / loudest
    axes.fill_between(np.arange(len(bins)) / 100, low, high, color=_WAVE, linewidth=0)
    axes.set(ylim=(-1.1, 3.6), yticks=[], ylabel="speech")
    keywords = _visible(axes, timeline.keywords, timeline.start)
    for left, right, _ in keywords:
        axes.axvspan(left, right, color=_KEYWORD, alpha=0.15, linewidth=0)
    for left, right, word in _visible(axes, timeline.words, timeline.start):
        key = any(word.start < keyword.end and keyword.start < word.end for _, _, keyword in keywords)
        axes.text(
            (left + right) / 2,
            1.15,
            word.label,
            rotation=50,
            rotation_mode="anchor",
            fontsize=11,
            color=_KEYWORD if key else "black",
            weight="bold" if key else "normal",
            in_layout=False,
            parse_math=False,
        )


def _draw_wrists(axes: Axes, wrists: WristHeights, label: str, start: float) -> None:
    axes.plot(wrists.times - start, wrists.left, color=_LEFT)
    axes.plot(wrists.times - start, wrists.right, color=_RIGHT)
    axes.grid(alpha=0.3)
    axes.set_ylabel(label)


def _lanes(timeline: Timeline) -> list[tuple[str, list[Span], str]]:
    """Name, spans and color of each lane of bars; controls that overlap get lanes of their own."""
    controls: list[list[Span]] = []
    for control in sorted(timeline.controls, key=lambda span: span.start):
        for lane in controls:
            if lane[-1].end <= control.start:
                lane.append(control)
                break
        else:
            controls.append([control])
    return [
        ("emotion", list(timeline.emotions), _EMOTION),
        *(("control", lane, _CONTROL) for lane in controls or [[]]),
        ("teleop", list(timeline.teleop), _TELEOP),
    ]


def _draw_spans(axes: Axes, lanes: Sequence[tuple[str, Sequence[Span], str]], start: float) -> None:
    for y, (_, spans, color) in enumerate(lanes):
        for left, right, span in _visible(axes, spans, start):
            axes.barh(y, right - left, 0.9, left, color=color or _SOURCES[span.source], edgecolor="white")
            if right - left > 0.062 * len(span.label):
                axes.text(
                    left + 0.04, y, span.label, va="center", fontsize=9, in_layout=False, parse_math=False
                )
    axes.set(ylim=(len(lanes) - 0.5, -0.5))
    axes.set_yticks(range(len(lanes)), [name for name, _, _ in lanes])
    axes.tick_params(axis="y", length=0)


def _visible(axes: Axes, spans: Sequence[Span], start: float) -> list[tuple[float, float, Span]]:
    """Where the spans seen in a row begin and end in it [s from the start]."""
    low, high = axes.get_xlim()
    ends = ((max(low, span.start - start), min(high, span.end - start), span) for span in spans)
    return [(left, right, span) for left, right, span in ends if left < right]


def _legend() -> list[Line2D | Patch]:
    return [
        *(Patch(color=color, label=f"window: {source}") for source, color in _SOURCES.items()),
        Line2D([], [], color=_LEFT, label="left wrist"),
        Line2D([], [], color=_RIGHT, label="right wrist"),
        Patch(color=_KEYWORD, alpha=0.3, label="keyword"),
        Line2D([], [], color=_KEYWORD, linestyle=":", label="its stroke"),
    ]
