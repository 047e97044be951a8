"""The kinds of files that recordings are read from."""

from gesture_bot.corpus import bvh_reader, landmarks_reader, lsg21_reader, text_reader
from gesture_bot.corpus.sources import Reader

READERS: tuple[Reader, ...] = (bvh_reader, text_reader, lsg21_reader, landmarks_reader)
"""The first that fits a file reads it."""
