"""The kinds of files that recordings are read from."""

from pathlib import Path

from gesture_bot.base.errors import FileFormatError
from gesture_bot.corpus import bvh_reader, landmarks_reader, lsg21_reader, text_reader
from gesture_bot.corpus.sources import Reader

READERS: tuple[Reader, ...] = (bvh_reader, text_reader, lsg21_reader, landmarks_reader)
"""The first that fits a file reads it."""


def reader_of(path: Path) -> Reader:
    """The reader that fits a file.

    Raises:
        FileFormatError: None does.
    """
    for reader in READERS:
        if reader.fits(path):
            return reader
    raise FileFormatError("no recording that can be read", str(path), [reader.KIND for reader in READERS])
