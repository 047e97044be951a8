"""Arrays by name in .npz files."""

import zipfile
import zlib
from pathlib import Path

import numpy as np

from gesture_bot.base.errors import FileFormatError


def array_names(path: Path) -> set[str]:
    """Names of the arrays in a file; none where it is no .npz file."""
    if path.suffix != ".npz":
        return set()
    try:
        with zipfile.ZipFile(path) as archive:
            return {name.removesuffix(".npy") for name in archive.namelist()}
    except (OSError, zipfile.BadZipFile):
        return set()


def load_array(path: Path, name: str) -> np.ndarray:
    """One array of a file.

    Raises:
        FileFormatError: It is missing, damaged or pickled.
    """
    try:
        with np.load(path) as arrays:
            array = arrays[name]
    except (OSError, ValueError, EOFError, LookupError, zipfile.BadZipFile, zlib.error) as error:
        raise FileFormatError(f"cannot read the array {name} of {path} ({error})") from error
    return array
