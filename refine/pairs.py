"""What the network learns from: real motion, and what the search finds for the sound of the same frames."""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from tqdm import tqdm

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.frames import WINDOW
from gesture_bot.corpus.database import LABELS, SEQUENCE, Database
from gesture_bot.matching.controls import Admission
from gesture_bot.matching.features import AUDIO_OFFSETS
from gesture_bot.matching.search import MAX_K, Search
from gesture_bot.matching.selector import LATELY
from gesture_bot.matching.settling import rest_pose

STRIDE = 5
"""Frames from one window to the next (MM22)."""

HELD_OUT = 0.1
"""Share of the recordings that are kept from the training; one at least."""


@dataclass(frozen=True)
class Pairs:
    """Windows of recordings: the real motion, and what the search found for the same sound.

    Attributes:
        real: (w, 64) rows of the database: sound and real motion.
        found: (2, w, 64) rows of the motion that was found: always the best match; and, drawn for each of
            the search's windows, one of the 2nd to the 15th.
    """

    real: np.ndarray
    found: np.ndarray


def held_out(database: Database, seed: int) -> np.ndarray:
    """The numbers of the recordings that are kept from the training, drawn at random.

    Raises:
        InvalidValueError: There are fewer than three: one is held out, and the search needs another one than
            the query's own.
    """
    recordings = np.unique(database.recording)
    if len(recordings) < 3:
        raise InvalidValueError("too few recordings to train on", len(recordings), ["3 and more"])
    count = max(1, round(HELD_OUT * len(recordings)))
    return np.sort(np.random.default_rng(seed).permutation(recordings)[:count])


def find_pairs(database: Database, held: np.ndarray, seed: int) -> tuple[Pairs, Pairs]:
    """Run the search of MM22 over the sound of all recordings.

    It runs through each recording as it would for speech, from rest on, each window the next query. Whatever
    it finds is from another recording, and from none that is held out: their sequences are taken out of the
    control mask. Where enough recordings have the emotion of the query's, it is from these, as the selector
    does it. As there, no window comes back within LATELY.

    Args:
        database: What is searched, and whose sound it is.
        held: The recordings that are held out.
        seed: Of the draw.

    Returns:
        Pairs of the recordings to train on, and of those that are held out.
    """
    walker = _Walker(database, held, seed)
    pairs: tuple[list[Pairs], list[Pairs]] = ([], [])
    for recording in tqdm(np.unique(database.recording), "searching", unit="recording", disable=None):
        for rows in stretches(database, recording):
            found = walker.found(recording, rows)
            windows = np.arange(0, len(rows) - SEQUENCE + 1, STRIDE)[:, None] + np.arange(SEQUENCE)
            pairs[recording in held].append(Pairs(rows[windows], found[:, windows]))
    trained, tested = (
        Pairs(np.concatenate([one.real for one in part]), np.concatenate([one.found for one in part], axis=1))
        for part in pairs
    )
    return trained, tested


def stretches(database: Database, recording: int) -> Iterator[np.ndarray]:
    """Rows of a recording's sequences, in runs without a gap."""
    starts = database.starts[database.recording == recording]
    rows = np.unique(starts[:, None] + np.arange(SEQUENCE))
    yield from np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1)


class _Walker:
    def __init__(self, database: Database, held: np.ndarray, seed: int) -> None:
        self._database, self._held, self._seed = database, held, seed
        self._search = Search(database)
        self._rest = self._search.pose_of(rest_pose(database))
        self._emotion = database.labels[:, LABELS.index("emotion")]

    def found(self, recording: int, rows: np.ndarray) -> np.ndarray:
        """(2, n) rows of the motion that is found for the sound of consecutive rows (n,) of a recording."""
        generator = np.random.default_rng([self._seed, recording, rows[0]])
        windows = -(-len(rows) // WINDOW)
        drawn = np.ones(windows, int), generator.integers(2, MAX_K + 1, windows)
        admission = self._admission(recording)
        return np.stack([self._walk(admission, rows, k) for k in drawn])

    def _admission(self, recording: int) -> Admission:
        database = self._database
        allowed = (database.recording != recording) & ~np.isin(database.recording, self._held)
        alike = allowed & (self._emotion == self._emotion[database.recording == recording][0])
        if alike.sum() >= MAX_K:
            allowed = alike
        mask = np.repeat(allowed[:, None], SEQUENCE, axis=1)
        return Admission(mask, int(allowed.sum()), float(allowed.mean()), ())

    def _walk(self, admission: Admission, rows: np.ndarray, ks: np.ndarray) -> np.ndarray:
        pose, found = self._rest, []
        lately: deque[tuple[int, int]] = deque(maxlen=LATELY // WINDOW)
        for row, k in zip(rows[::WINDOW], ks, strict=True):
            sound = self._search.audio_of(self._database.features[row : row + AUDIO_OFFSETS[-1] + 1])
            match = self._search.find(pose, sound, admission.without(lately), int(k))
            assert match  # there is another recording
            first = self._search.row(match.sequence, match.frame)
            found.append(np.arange(first, first + WINDOW))
            pose = self._search.pose_at(first + WINDOW - 1)
            lately.appendleft((match.sequence, match.frame))
        return np.concatenate(found)[: len(rows)]
