"""What the network learns from: real motion, and what the search finds for the sound of the same frames."""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from tqdm import tqdm

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.frames import WINDOW, KeypointClip
from gesture_bot.base.keypoints import with_bone_lengths
from gesture_bot.corpus.database import SEQUENCE, Database
from gesture_bot.matching.controls import Admission
from gesture_bot.matching.features import AUDIO_OFFSETS
from gesture_bot.matching.search import MAX_K, Search
from gesture_bot.matching.selector import LATELY
from gesture_bot.matching.settling import rest_pose
from gesture_bot.refine.smoothing import WindowJoiner

HELD_OUT = 0.1
"""Share of the recordings that are kept from the training; one at least."""


@dataclass(frozen=True)
class Walk:
    """A stretch of a recording, and what the search finds for its sound.

    Attributes:
        recording: Its number.
        rows: (n,) of the database: sound and real motion.
        found: (2, n) rows of the motion that was found: always the best match; and, drawn for each of the
            search's windows, one of the 2nd to the 15th (MM22). A window begins every 8 frames.
        joined: (2, n, 17, 3) that motion without jumps where windows meet [m].
    """

    recording: int
    rows: np.ndarray
    found: np.ndarray
    joined: np.ndarray


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


def walks(database: Database, held: np.ndarray, seed: int) -> list[Walk]:
    """Run the search of MM22 over the sound of all recordings.

    It runs through each recording as it would for speech, from rest on, each window the next query. Whatever
    it finds is from another recording, and from none that is held out: their sequences are taken out of the
    control mask. As in the selector, no window comes back within LATELY.

    Args:
        database: What is searched, and whose sound it is.
        held: The recordings that are held out.
        seed: Of the draw.
    """
    walker = _Walker(database, held, seed)
    return [
        walker.walk(int(recording), rows)
        for recording in tqdm(np.unique(database.recording), "searching", unit="recording", disable=None)
        for rows in stretches(database, recording)
    ]


def stretches(database: Database, recording: int) -> Iterator[np.ndarray]:
    """Rows of a recording's sequences, in runs without a gap."""
    starts = database.starts[database.recording == recording]
    rows = np.unique(starts[:, None] + np.arange(SEQUENCE))
    yield from np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1)


def joined(windows: np.ndarray) -> np.ndarray:
    """Motion of windows of 8 frames, joined: (n, 17, 3) -> (n, 17, 3) [m]."""
    joiner = WindowJoiner()
    made = []
    for start in range(0, len(windows), WINDOW):
        joiner.push(KeypointClip(start, windows[start : start + WINDOW]))
        frames = slice(start - joiner.start, None)
        made.append(with_bone_lengths(joiner.motion[frames], joiner.lengths[frames]))
    return np.concatenate(made)


class _Walker:
    def __init__(self, database: Database, held: np.ndarray, seed: int) -> None:
        self._database, self._held, self._seed = database, held, seed
        self._search = Search(database)
        self._rest = self._search.pose_of(rest_pose(database))

    def walk(self, recording: int, rows: np.ndarray) -> Walk:
        """Of consecutive rows (n,) of a recording."""
        generator = np.random.default_rng([self._seed, recording, rows[0]])
        windows = -(-len(rows) // WINDOW)
        drawn = np.ones(windows, int), generator.integers(2, MAX_K + 1, windows)
        allowed = (self._database.recording != recording) & ~np.isin(self._database.recording, self._held)
        mask = np.repeat(allowed[:, None], SEQUENCE, axis=1)
        admission = Admission(mask, int(allowed.sum()), float(allowed.mean()), ())
        found = np.stack([self._found(admission, rows, k) for k in drawn])
        return Walk(
            recording, rows, found, np.stack([joined(self._database.keypoints[one]) for one in found])
        )

    def _found(self, admission: Admission, rows: np.ndarray, ks: np.ndarray) -> np.ndarray:
        """(n,) rows of the motion that is found for the sound of others (n,)."""
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
