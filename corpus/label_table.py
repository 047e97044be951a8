"""Labels of recordings from a table: CSV with the columns file, emotion, style and speaker."""

import csv
from collections.abc import Iterable, Mapping
from pathlib import Path

from gesture_bot.base.errors import FileFormatError, InvalidValueError
from gesture_bot.corpus.database import LABELS

SHOWN = 10
"""Names of files that an error lists."""


def read_label_table(path: Path) -> dict[str, dict[str, str]]:
    """The labels of each file, by kind; empty cells are left out.

    Any word is a label. Of the emotions, the labels of hri_msgs/Expression answer to `emotion`.

    Raises:
        FileFormatError: The table cannot be read, or lacks a column or has one that is unknown.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as table:
            reader = csv.DictReader(table, strict=True, skipinitialspace=True, restval="")
            columns, rows = reader.fieldnames or [], list(reader)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise FileFormatError(f"cannot read {path} ({getattr(error, 'strerror', error)})") from error
    if "file" not in columns:
        raise FileFormatError(f"{path} has no column called", "file", ["file", *LABELS])
    for column in columns:
        if column not in ("file", *LABELS):
            raise FileFormatError(f"column of {path}", column, ["file", *LABELS])
    for row in rows:
        if None in row:
            raise FileFormatError(f"{path}: more cells than columns in the row of", row["file"])
    return {row["file"]: {kind: row[kind] for kind in LABELS if row.get(kind)} for row in rows}


def _some(names: Iterable[str]) -> list[str]:
    shown = sorted(names)
    return shown if len(shown) <= SHOWN else [*shown[:SHOWN], "..."]


def labels_by_file(
    table: Mapping[str, Mapping[str, str]], files: Iterable[Path]
) -> dict[Path, dict[str, str]]:
    """The labels of each of some files.

    A table calls a file by its name, with or without its ending, or by as much of its path as it takes.

    Raises:
        InvalidValueError: The table names a file that is not there.
    """
    labels: dict[Path, dict[str, str]] = {}
    ends: dict[str, list[Path]] = {}
    for file in files:
        labels[file] = {}
        for end in {file.name, file.stem}:
            ends.setdefault(end, []).append(file)
    for name, given in table.items():
        *folders, end = Path(name).parts or [""]
        before = len(folders) + 1
        named = [file for file in ends.get(end, ()) if list(file.parts[-before:-1]) == folders]
        if not named:
            raise InvalidValueError(
                "the label table names a file of motion that is not among the sources", name, _some(ends)
            )
        for file in named:
            labels[file] |= given
    return labels
