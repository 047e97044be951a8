"""Arrays by name in .npz files."""

import zipfile
from pathlib import Path

import numpy as np

from gesture_bot.base.errors import FileFormatError


def array_names(path: Path) -> set[str]:
    """Names of the arrays in a file; none where it is no .npz file."""
    if path.suffix != ".npz" or not zipfile.is_zipfile(path):
        return set()
    with zipfile.ZipFile(path) as archive:
        return {name.removesuffix(".npy") for name in archive.namelist()}


def load_array(path: Path, name: str) -> np.ndarray:
    """One array of a file.

    Raises:
        FileFormatError: It is missing, damaged or pickled, or holds numbers that are not finite.
    """
    try:
        with np.load(path) as arrays:
            array = arrays[name]
    except (OSError, ValueError, EOFError, LookupError, zipfile.BadZipFile) as error:
        raise FileFormatError(f"cannot read the array {name} of {path} ({error})") from error
    return array
