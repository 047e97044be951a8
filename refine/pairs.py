"""What the network learns from: real motion, and what the search finds for the sound of the same frames."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from tqdm import tqdm

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.frames import FRAME_RATE, KeypointClip, frame_time
from gesture_bot.base.keypoints import KEYPOINTS, with_bone_lengths
from gesture_bot.corpus.database import SEQUENCE, Database
from gesture_bot.matching.emotions import NEUTRAL
from gesture_bot.matching.search import MAX_K
from gesture_bot.matching.selector import AHEAD, Selector
from gesture_bot.matching.speaker import is_loud
from gesture_bot.refine.bounds import BOUNDS, bounds_of, constraints_of, measured
from gesture_bot.refine.hindsight import hindsight
from gesture_bot.refine.offline import LEAD_IN
from gesture_bot.refine.smoothing import WindowJoiner

HELD_OUT = 0.1
"""Share of the recordings that are kept from the training; one at least."""


@dataclass(frozen=True)
class Walk:
    """A stretch of a recording, and what the selector finds for its sound.

    Attributes:
        recording: Its number.
        rows: (n,) of the recordings: sound and real motion.
        heard: (n, 28) the sound as the selector hears it, in the voice of the database.
        joined: (3, n, 17, 3) the motion that was found, without jumps where windows meet [m]: always the best
            match; for each window one of the first 15, drawn (MM22); and either of these under controls.
        bounds: (n, 16) the controls, which the real motion keeps; see bounds.bounds_of.
        sequences: The sequences of the database that were shown.
    """

    recording: int
    rows: np.ndarray
    heard: np.ndarray
    joined: np.ndarray
    bounds: np.ndarray
    sequences: np.ndarray


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


def walks(database: Database, spoken: Database, held: np.ndarray, seed: int) -> list[Walk]:
    """Let the selector gesture to the sound of all recordings, as it does when the robot speaks.

    Where the recordings are those that are searched, too, what it finds is from another one, and from none
    that is held out.

    Args:
        database: What is searched.
        spoken: The recordings; it may be the same.
        held: Those of them that are held out.
        seed: Of every draw.
    """
    walker = _Walker(database, spoken, held, seed)
    return [
        walker.walk(int(recording), rows)
        for recording in tqdm(np.unique(spoken.recording), "searching", unit="recording", disable=None)
        for rows in stretches(spoken, recording)
    ]


def stretches(database: Database, recording: int) -> Iterator[np.ndarray]:
    """Rows of a recording's sequences, in runs without a gap."""
    starts = database.starts[database.recording == recording]
    rows = np.unique(starts[:, None] + np.arange(SEQUENCE))
    yield from np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1)


class _Walker:
    def __init__(self, database: Database, spoken: Database, held: np.ndarray, seed: int) -> None:
        self._database, self._spoken, self._held, self._seed = database, spoken, held, seed
        self._selector = Selector(database, {}, NEUTRAL)
        self._measured = measured(spoken)
        self._ranked = np.sort(self._measured, axis=0)

    def walk(self, recording: int, rows: np.ndarray) -> Walk:
        """Of consecutive rows (n,) of a recording."""
        generator = np.random.default_rng([self._seed, recording, rows[0]])
        free = np.full((len(rows), BOUNDS), np.nan)
        asked = hindsight(self._measured[rows], self._ranked, generator)
        shown = [
            self._show(recording, rows, bounds, k, generator)
            for k, bounds in ((1, free), (MAX_K, free), (int(generator.choice([1, MAX_K])), asked))
        ]
        frames = slice(LEAD_IN, LEAD_IN + len(rows))
        return Walk(
            recording,
            rows,
            shown[0].heard,
            np.stack([one.joined[frames] for one in shown]),
            shown[2].bounds[frames],
            np.unique(np.concatenate([one.sequences for one in shown])),
        )

    def _show(
        self, recording: int, rows: np.ndarray, bounds: np.ndarray, k: int, generator: np.random.Generator
    ) -> "_Shown":
        among = None
        if self._spoken is self._database:
            among = ~np.isin(self._database.recording, [recording, *self._held])
        selector = self._selector.fresh(k, int(generator.integers(1 << 31)), among)
        features = self._spoken.features[rows]
        for frame, (sound, loud) in enumerate(zip(features, is_loud(features), strict=True), LEAD_IN):
            selector.hearing.add_features(frame, sound, bool(loud))
        heard = selector.hearing.features(LEAD_IN, LEAD_IN + len(rows))
        joiner, frames = WindowJoiner(), LEAD_IN + len(rows)
        joined, kept = (
            np.empty((frames + SEQUENCE, len(KEYPOINTS), 3)),
            np.full((frames + SEQUENCE, BOUNDS), np.nan),
        )
        sequences = []
        for frame in range(frames):
            coming = np.clip(frame + round(AHEAD * FRAME_RATE) - LEAD_IN, 0, len(rows) - 1)
            selector.set_controls(constraints_of(bounds[coming]))
            for window in selector.plan(frame_time(frame)):
                joiner.push(KeypointClip(window.start, window.keypoints))
                new = slice(-len(window.keypoints), None)
                joined[window.start : window.stop] = with_bone_lengths(
                    joiner.motion[new], joiner.lengths[new]
                )
                kept[window.start : window.stop] = bounds_of(window.kept)
                if window.source == "speech":
                    sequences.append(window.sequence)
        return _Shown(heard, joined, kept, np.array(sequences, int))


@dataclass(frozen=True)
class _Shown:
    """What the selector shows to a recording, from LEAD_IN frames before its sound on; see Walk."""

    heard: np.ndarray
    joined: np.ndarray
    bounds: np.ndarray
    sequences: np.ndarray
