"""The table of quality as text, as CSV and as pictures."""

import csv
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from gesture_bot.base.files import write_whole
from gesture_bot.evaluate.quality import Quality, Row
from gesture_bot.evaluate.resampling import Metric
from gesture_bot.evaluate.rhythm import THRESHOLDS

_ACROSS = 5
"""Metrics side by side in the text."""

_ARROWS = {"lower": " ↓", "higher": " ↑", "": ""}

_COLORS = ["#59636e", "#b9c0c8", "#d1495b", "#f4b860", "#9dc3e6", "#1f6fb2", "#2e8b57"]


def markdown(quality: Quality) -> str:
    """The table as Markdown, a few metrics at a time: value, 95% interval, and a star where a system differs
    from the one that is smoothed alone by more than the interval of their difference.
    """
    parts = []
    for begin in range(0, len(quality.metrics), _ACROSS):
        metrics = quality.metrics[begin : begin + _ACROSS]
        table = [["system", "smoothed", *(_title(metric) for metric in metrics)]]
        table += [
            [row.system, row.smoothed, *(_cell(row, metric) for metric in metrics)] for row in quality.rows
        ]
        widths = [max(map(len, column)) for column in zip(*table, strict=True)]
        lines = [
            "| " + " | ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)) + " |"
            for line in table
        ]
        lines.insert(1, "|" + "|".join("-" * (width + 2) for width in widths) + "|")
        parts.append("\n".join(lines))
    return "\n\n".join(parts)


def _title(metric: Metric) -> str:
    unit = f" [{metric.unit}]" if metric.unit else ""
    return f"{metric.name}{unit}{_ARROWS[metric.better]}"


def _cell(row: Row, metric: Metric) -> str:
    one = row.estimates[metric.name]
    if np.isnan(one.value):
        return "-"
    low, high = one.interval
    return f"{one.value:.{metric.decimals}f} ({low:.{metric.decimals}f} to {high:.{metric.decimals}f})" + (
        "*" if differs(row, metric) else ""
    )


def differs(row: Row, metric: Metric) -> bool:
    """Whether a system differs from smoothing alone: by more than the interval, and visibly."""
    low, high = row.differences[metric.name].interval
    least = 0.5 / 10**metric.decimals
    return low > least or high < -least


def quality_lines(quality: Quality) -> Iterator[dict[str, object]]:
    """A line for each system and metric: value, interval, and both of the difference to smoothing alone."""
    for row in quality.rows:
        for metric in quality.metrics:
            one, difference = row.estimates[metric.name], row.differences[metric.name]
            low, high = one.interval
            difference_low, difference_high = difference.interval
            yield {
                "system": row.system,
                "smoothed": row.smoothed,
                "metric": metric.name,
                "unit": metric.unit,
                "value": one.value,
                "low": low,
                "high": high,
                "difference": difference.value,
                "difference_low": difference_low,
                "difference_high": difference_high,
            }


def write_quality(folder: Path, quality: Quality, notes: str) -> list[Path]:
    """Write quality.md, quality.csv, quality.png and pmb.png (where beats are known); the files.

    Args:
        folder: Where to.
        quality: The table.
        notes: What stands below the table.
    """
    files = [folder / "quality.md", folder / "quality.csv", folder / "quality.png"]
    with write_whole(files[0]) as temporary:
        temporary.write_text(f"{markdown(quality)}\n\n{notes}\n", encoding="utf-8")
    lines = list(quality_lines(quality))
    with write_whole(files[1]) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, lines[0].keys())
        writer.writeheader()
        writer.writerows(lines)
    _save(files[2], _figures(quality))
    if not np.isnan(quality.rows[0].curve).all():
        files.append(folder / "pmb.png")
        _save(files[-1], _curves(quality))
    return files


def _save(path: Path, figure: Figure) -> None:
    with write_whole(path) as temporary:
        figure.savefig(temporary)


def _figures(quality: Quality) -> Figure:
    """A panel a metric: each system's value and interval."""
    measured = [one for one in quality.metrics if not np.isnan(quality.rows[-1].estimates[one.name].value)]
    columns = 5
    across = -(-len(measured) // columns)
    figure = Figure(figsize=(3.2 * columns, 2.4 * across), dpi=100, layout="constrained")
    panels = figure.subplots(across, columns, squeeze=False, sharey=True).ravel()
    places = np.arange(len(quality.rows))
    for axes, metric in zip(panels, measured, strict=False):
        for place, row, color in zip(places, quality.rows, _COLORS, strict=False):
            one = row.estimates[metric.name]
            axes.plot(one.interval, [place, place], color=color, linewidth=2)
            axes.plot(one.value, place, "o", color=color)
        axes.set_title(_title(metric), fontsize=10)
        axes.set_yticks(places, [row.system for row in quality.rows], fontsize=8)
        axes.grid(axis="x", alpha=0.3)
        axes.spines[["top", "right"]].set_visible(False)
    panels[0].invert_yaxis()
    for axes in panels[len(measured) :]:
        axes.set_visible(False)
    return figure


def _curves(quality: Quality) -> Figure:
    figure = Figure(figsize=(7, 5), dpi=100, layout="constrained")
    axes = figure.subplots()
    for row, color in zip(quality.rows, _COLORS, strict=False):
        axes.plot(THRESHOLDS, row.curve, color=color, label=row.system)
    axes.set(xlabel="threshold [s]", ylabel="PMB [%]", xlim=(0, THRESHOLDS[-1]), ylim=(0, 100))
    axes.grid(alpha=0.3)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False, fontsize=8)
    return figure
