"""A gesture database in one picture: how high, fast and wide the hands are, the labels, and many poses."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gesture_bot.base.files import write_whole
from gesture_bot.base.keypoints import BONES, INDEX, KEYPOINTS, MATCHED
from gesture_bot.corpus.database import Database
from gesture_bot.evaluate.database_report import DRAWN, DatabaseReport, frames_of

_POSES = (4, 9)
"""Rows and columns of the contact sheet."""

_LOOKED_AT = 20_000
"""Frames that its poses are chosen from, at most."""

_CELL = (1.6, 1.4)
"""Width and height of one pose's place [m]: hands reach 0.8 m from the spine, and 1.1 m over the pelvis."""

_FLOOR = 0.25
"""The place of a pose begins so far below its pelvis [m]."""

_MOST_LABELS = 10
"""Labels of one kind that are drawn; the others are counted together."""

_LEFT, _RIGHT, _BODY, _LABEL = "#1f6fb2", "#d1495b", "#59636e", "#8fb8a0"
_SIDES = {"left": _LEFT, "right": _RIGHT}


def write_database_picture(path: Path, database: Database, report: DatabaseReport, title: str) -> None:
    """Draw a database.

    Args:
        path: File to write, ending in .png.
        database: The database.
        report: Its figures.
        title: What is written above.
    """
    figure = Figure(figsize=(16, 10.5), dpi=90, layout="constrained")
    figure.suptitle(title, fontsize=14, parse_math=False)
    upper, lower = figure.subfigures(2, 1, squeeze=False, height_ratios=(1, 1.8))[:, 0]
    panels = upper.subplots(1, 4, width_ratios=(1, 1, 1, 1.2))
    for axes, (name, (quantity, unit)) in zip(panels, DRAWN.items(), strict=False):
        _draw_histogram(axes, 100 * report.quantities[quantity], f"{name} [{unit}]")
    panels[0].legend(frameon=False)
    _draw_labels(panels[3], report.labels)
    _draw_poses(lower.subplots(), database)
    with write_whole(path) as temporary:
        figure.savefig(temporary)


def _draw_histogram(axes: Axes, values: np.ndarray, label: str) -> None:
    """Shares of the frames, of the left and of the right hand: (2, n)."""
    bins = np.linspace(values.min(), np.percentile(values, 99.5), 41).tolist()
    for side, hand in zip(_SIDES, values, strict=True):
        weights = np.full(len(hand), 100 / len(hand))
        axes.hist(hand, bins, weights=weights, color=_SIDES[side], alpha=0.25)
        axes.hist(hand, bins, weights=weights, color=_SIDES[side], histtype="step", label=f"{side} hand")
    axes.set(xlabel=label, ylabel="frames [%]")
    axes.spines[["top", "right"]].set_visible(False)


def _draw_labels(axes: Axes, labels: dict[str, dict[str, int]]) -> None:
    """Sequences by label, one kind below the other."""
    names: list[str] = []
    counts: list[int] = []
    for kind, sequences in labels.items():
        ranked = sorted(sequences.items(), key=lambda item: -item[1])
        shown = dict(ranked[:_MOST_LABELS])
        if rest := ranked[_MOST_LABELS:]:
            shown[f"{len(rest)} others"] = sum(count for _, count in rest)
        names += [f"{kind}: {name or 'not labelled'}" for name in shown]
        counts += shown.values()
    bars = axes.barh(range(len(names)), counts, color=_LABEL)
    axes.bar_label(bars, padding=3)
    axes.set_yticks(range(len(names)), names, parse_math=False)
    axes.set(ylim=(max(len(names), 4) - 0.5, -0.5), xlim=(0, 1.15 * max(counts)), xlabel="sequences")
    axes.spines[["top", "right"]].set_visible(False)


def _draw_poses(axes: Axes, database: Database) -> None:
    """Stick figures that face the reader, so that their left hand is on the right; lowest hands first."""
    rows, columns = _POSES
    frames = frames_of(database)
    frames = frames[:: -(-len(frames) // _LOOKED_AT)]
    poses = database.keypoints[frames].astype(np.float64)
    matched = poses[:, [INDEX[name] for name in MATCHED]].reshape(len(poses), -1)
    chosen, shares = spread_out(matched, rows * columns)
    wrists = poses[chosen][:, [INDEX["left_wrist"], INDEX["right_wrist"]], 2].mean(axis=1)
    width, height = _CELL
    for place, index in enumerate(np.argsort(wrists)):
        row, column = divmod(place, columns)
        origin = np.array([column * width, -row * height])
        _draw_pose(axes, poses[chosen[index]][:, 1:] + origin)
        axes.text(
            origin[0], origin[1] - _FLOOR, f"{100 * shares[index]:.1f}%", ha="center", va="top", color=_BODY
        )
    axes.set(xlim=(-width / 2, (columns - 0.5) * width), ylim=(-(rows - 1) * height - 0.45, height - _FLOOR))
    axes.set_aspect("equal")
    axes.set_axis_off()
    axes.set_title(
        "Poses far from each other, and the share of all frames that each is nearest to", fontsize=11
    )


def _draw_pose(axes: Axes, spots: np.ndarray) -> None:
    for parent, child in BONES:
        color = _SIDES.get(KEYPOINTS[child].partition("_")[0], _BODY)
        if KEYPOINTS[child].endswith(("hip", "shoulder")):
            color = _BODY
        axes.plot(*spots[[parent, child]].T, color=color, linewidth=2, solid_capstyle="round")
    middle = spots[[INDEX["head"], INDEX["head_top"]]].mean(axis=0)
    axes.plot(*middle, "o", color=_BODY, markersize=9)


def spread_out(points: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Points from all over a cloud: the one in its middle, then always the one farthest from all so far.

    Args:
        points: (n, d).
        count: How many to choose; fewer where there are not so many.

    Returns:
        Indices of the chosen points, and the share of all points that each is nearest to.
    """
    chosen = [int(np.linalg.norm(points - points.mean(axis=0), axis=1).argmin())]
    nearest = np.linalg.norm(points - points[chosen[0]], axis=1)
    owner = np.zeros(len(points), int)
    while len(chosen) < count and nearest.max() > 0:
        chosen.append(int(nearest.argmax()))
        distance = np.linalg.norm(points - points[chosen[-1]], axis=1)
        owner[distance < nearest] = len(chosen) - 1
        nearest = np.minimum(nearest, distance)
    return np.array(chosen), np.bincount(owner, minlength=len(chosen)) / len(points)
