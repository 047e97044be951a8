"""Keypoints in text files: a frame a line, x y z of each joint, separated by spaces, tabs or commas."""

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from gesture_bot.base.errors import FileFormatError
from gesture_bot.corpus.sources import Take

KIND = "keypoint text (.txt, .csv)"

_SEPARATOR = re.compile(r"\s*[,;]\s*|\s+")
_FEWEST = 7
"""Joints that a speaker needs: the neck, shoulders, elbows and wrists."""


def fits(path: Path) -> bool:
    """Whether a .txt or .csv file begins with a line of coordinates, or with one that names them.

    Data sets hold transcripts and annotations under the same endings.
    """
    if path.suffix.lower() not in (".txt", ".csv"):
        return False
    try:
        with path.open(encoding="utf-8-sig") as lines:
            first = _cells(lines.readline())
    except (OSError, UnicodeDecodeError):
        return False
    numbers = len(first) if _are_numbers(first) else 3 * len(_named_columns(first))
    return numbers % 3 == 0 and numbers >= 3 * _FEWEST


def read(path: Path) -> Iterator[Take]:
    """The one take of a text file.

    A first line may name the columns: those called NAME_x, NAME_y and NAME_z are the joint NAME, any others
    are left out. Without it the joints are "0", "1" and so on. A coordinate that is empty or nan is lost, and
    so is a joint at 0 0 0 that is not always there.

    Raises:
        FileFormatError: The file cannot be read, or a line does not hold as many numbers as the first.
    """
    try:
        rows = [_cells(line) for line in path.read_text(encoding="utf-8-sig").splitlines() if line.strip()]
    except (OSError, UnicodeDecodeError) as error:
        raise FileFormatError(f"cannot read {path} ({getattr(error, 'strerror', error)})") from error
    columns = {} if _are_numbers(rows[0]) else _named_columns(rows.pop(0))
    if not rows:
        raise FileFormatError(f"{path} holds no frames")
    table = _numbers(path, rows)
    named = list(columns.values())
    positions = table[:, named] if named else table.reshape(len(table), -1, 3)
    joints = tuple(columns) or tuple(map(str, range(positions.shape[1])))
    at_zero = (positions == 0).all(axis=2)
    positions[at_zero & ~at_zero.all(axis=0)] = np.nan
    yield Take(path.stem, joints, positions, rate=None)


def _cells(line: str) -> list[str]:
    return _SEPARATOR.split(line.strip())


def _are_numbers(cells: list[str]) -> bool:
    try:
        [float(cell or "nan") for cell in cells]
    except ValueError:
        return False
    return True


def _named_columns(cells: list[str]) -> dict[str, list[int]]:
    """The columns x, y, z of each joint that a header names in full."""
    places = {cell.strip("'\"").lower(): place for place, cell in enumerate(cells)}
    names = [cell.strip("'\"")[:-2] for cell in cells if cell.strip("'\"").lower().endswith("_x")]
    wanted = {name: [f"{name.lower()}_{axis}" for axis in "xyz"] for name in names}
    return {
        name: [places[column] for column in columns]
        for name, columns in wanted.items()
        if all(column in places for column in columns)
    }


def _numbers(path: Path, rows: list[list[str]]) -> np.ndarray:
    """The cells as numbers, (frames, columns)."""
    for number, row in enumerate(rows, 1):
        if len(row) != len(rows[0]) or not _are_numbers(row):
            raise FileFormatError(f"{path}: frame {number} does not hold {len(rows[0])} numbers")
    return np.array([[float(cell or "nan") for cell in row] for row in rows])
