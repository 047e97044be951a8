"""Labels of recordings from a table: CSV with the columns file, emotion, style and speaker."""

import csv
from collections.abc import Iterable, Mapping
from pathlib import Path

from gesture_bot.base.errors import FileFormatError, InvalidValueError
from gesture_bot.corpus.database import LABELS


def read_label_table(path: Path) -> dict[str, dict[str, str]]:
    """The labels of each file, by kind; empty cells are left out.

    Any word is a label. Of the emotions, the labels of hri_msgs/Expression answer to `emotion`.

    Raises:
        FileFormatError: The table cannot be read, or lacks a column or has one that is unknown.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as table:
            rows = list(csv.DictReader(table, strict=True, skipinitialspace=True))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise FileFormatError(f"cannot read {path} ({getattr(error, 'strerror', error)})") from error
    if not rows or "file" not in rows[0]:
        raise FileFormatError(f"{path} has no column called", "file", ["file", *LABELS])
    for column in rows[0]:
        if column not in ("file", *LABELS):
            raise FileFormatError(f"column of {path}", column, ["file", *LABELS])
    return {row["file"]: {kind: row[kind] for kind in LABELS if row.get(kind)} for row in rows}


def labels_by_file(
    table: Mapping[str, Mapping[str, str]], files: Iterable[Path]
) -> dict[Path, dict[str, str]]:
    """The labels of each of some files.

    A table calls a file by its name, with or without its ending, or by as much of its path as it takes.

    Raises:
        InvalidValueError: The table names a file that is not there.
    """
    labels: dict[Path, dict[str, str]] = {file: {} for file in files}
    for name, given in table.items():
        parts = Path(name).parts
        named = [
            file
            for file in labels
            if parts in (file.parts[-len(parts) :], file.with_suffix("").parts[-len(parts) :])
        ]
        if not named:
            raise InvalidValueError("the label table names a file that is not among the sources", name)
        for file in named:
            labels[file] |= given
    return labels
