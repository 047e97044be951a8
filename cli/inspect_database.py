"""`gesture-bot inspect`: what a gesture database holds, printed and drawn."""

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table
from safetensors import safe_open

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.keypoints import KEYPOINTS
from gesture_bot.corpus.database import FORMAT, Database
from gesture_bot.corpus.demo import database_path
from gesture_bot.evaluate.database_picture import write_database_picture
from gesture_bot.evaluate.database_report import DRAWN, DatabaseReport, database_report

_QUANTILES = (1, 15, 50, 85, 99)
"""Percentiles that are printed; MM22's controls use the 15th and the 85th."""


def command(options: argparse.Namespace) -> int:
    """Print and draw `options.database`, a file or "demo"; the exit status.

    Raises:
        GestureBotError: The file is no database that this version reads, or the picture is no .png.
    """
    path = database_path(options.database)
    picture = options.output or Path(f"{Path(options.database).stem}.png")
    if picture.suffix != ".png":
        raise InvalidValueError("cannot draw into this kind of file", picture.name, [".png"])
    database = Database.load(path)
    report = database_report(database)
    console = Console(highlight=False, markup=False)
    console.print(_facts(path, database, report))
    console.print(_quantiles(report))
    title = f"{path.name}: {report.duration}, {report.sequences} sequences"
    write_database_picture(picture, database, report, title)
    console.print(f"wrote {picture}", soft_wrap=True)
    return 0


def _facts(path: Path, database: Database, report: DatabaseReport) -> Table:
    with safe_open(path, framework="numpy") as opened:
        header = json.loads(opened.metadata()[FORMAT])
    about = database.metadata
    facts = {
        "file": path,
        "version": f"{header['version']}, checksum {header['checksum']}",
        "body": f"{len(KEYPOINTS)} keypoints, {header['frame_rate']} frames a second",
        "motion": report.duration,
        "recordings": report.recordings,
        "sequences": report.sequences,
        **{kind: _listed(counts) for kind, counts in report.labels.items()},
        "provenance": about.get("provenance", "not stated"),
        "licence": about.get("licence", "not stated"),
        "settings": _listed(about.get("settings", {})),
        **_sources(about.get("sources", [])),
    }
    table = Table.grid(padding=(0, 2))
    for name, fact in facts.items():
        table.add_row(name, str(fact))
    return table


def _sources(sources: list[dict[str, Any]]) -> dict[str, str]:
    """How many files the database was built from, and what became of their frames."""
    if not sources:
        return {}
    maps = sorted({source["skeleton"] for source in sources})
    frames: dict[str, int] = {}
    for source in sources:
        for what, count in source["frames"].items():
            frames[what] = frames.get(what, 0) + count
    cut = {what: count for what, count in frames.items() if what not in ("read", "kept", "mended")}
    return {
        "sources": f"{len(sources)} files, read with {', '.join(maps)}",
        "frames": _listed({what: frames.get(what, 0) for what in ("read", "kept", "mended")}),
        "cut": _listed({what: count for what, count in cut.items() if count}) or "nothing",
    }


def _listed(values: dict[str, Any]) -> str:
    return ", ".join(f"{name or 'not labelled'} {value}" for name, value in values.items())


def _quantiles(report: DatabaseReport) -> Table:
    table = Table("", *(f"p{percentile}" for percentile in _QUANTILES), box=None, pad_edge=False)
    for column in table.columns[1:]:
        column.justify = "right"
    for name, (quantity, unit) in DRAWN.items():
        for side, values in zip(("left", "right"), 100 * report.quantities[quantity], strict=True):
            table.add_row(
                f"{side} {name} [{unit}]", *(f"{value:.1f}" for value in np.percentile(values, _QUANTILES))
            )
    return table
