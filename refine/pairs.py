"""What the network learns from: real motion, and what the search finds for the sound of the same frames."""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import maximum_filter1d
from tqdm import tqdm

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.frames import WINDOW, KeypointClip
from gesture_bot.base.keypoints import with_bone_lengths
from gesture_bot.corpus.database import SEQUENCE, Database
from gesture_bot.matching.controls import FEWEST, Admission, Controls
from gesture_bot.matching.features import AUDIO_OFFSETS
from gesture_bot.matching.hearing import ONSET
from gesture_bot.matching.quantities import QUANTITIES, measure
from gesture_bot.matching.search import MAX_K, Search, eligible
from gesture_bot.matching.selector import LATELY
from gesture_bot.matching.settling import nearest, rest_pose, rest_poses
from gesture_bot.matching.speaker import Speaker, is_loud, speech_statistics
from gesture_bot.refine.bounds import BOUNDS, bounds_of, constraints_of
from gesture_bot.refine.hindsight import hindsight
from gesture_bot.refine.smoothing import WindowJoiner

HELD_OUT = 0.1
"""Share of the recordings that are kept from the training; one at least."""


@dataclass(frozen=True)
class Walk:
    """A stretch of a recording, and what the search finds for its sound.

    Attributes:
        recording: Its number.
        rows: (n,) of the recordings: sound and real motion.
        heard: (n, 28) the sound in the voice of the database, as the selector hears it; see Speaker.
        found: (3, n) rows of the database, the motion that was found: always the best match; drawn for each
            of the search's windows, one of the 2nd to the 15th (MM22); and either of these under controls. A
            window begins every 8 frames. -1 where nobody speaks.
        joined: (3, n, 17, 3) that motion without jumps where windows meet [m].
        bounds: (n, 16) the controls, which the real motion keeps; see bounds.bounds_of.
    """

    recording: int
    rows: np.ndarray
    heard: np.ndarray
    found: np.ndarray
    joined: np.ndarray
    bounds: np.ndarray


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
    """Run the search of MM22 over the sound of all recordings.

    It runs through each recording as it would for speech, from rest on, each window the next query; where
    nobody speaks, it rests. Where the recordings are those that are searched, too, what it finds is from
    another one, and from none that is held out: their sequences are taken out of the control mask. As in the
    selector, no window comes back within LATELY.

    Args:
        database: What is searched.
        spoken: The recordings; it may be the same.
        held: Those of them that are held out.
        seed: Of the draw.
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
    def __init__(self, database: Database, spoken: Database, held: np.ndarray, seed: int) -> None:
        self._database, self._spoken, self._held, self._seed = database, spoken, held, seed
        self._search = Search(database)
        self._rest = nearest(rest_poses(database), rest_pose(database))
        self._controls, self._voice = Controls(database), speech_statistics(database)
        measured = measure(spoken)
        self._measured = np.concatenate([measured[quantity] for quantity in QUANTITIES]).T
        self._ranked = np.sort(self._measured, axis=0)

    def walk(self, recording: int, rows: np.ndarray) -> Walk:
        """Of consecutive rows (n,) of a recording."""
        features = self._spoken.features[rows]
        loud, speaker = is_loud(features), Speaker(*self._voice)
        heard = np.stack([speaker.push(*frame) for frame in zip(features, loud, strict=True)])
        # Arms move a little before speech, and through short pauses.
        speech = np.maximum.reduceat(maximum_filter1d(loud, 2 * ONSET + 1), np.arange(0, len(rows), WINDOW))
        generator = np.random.default_rng([self._seed, recording, rows[0]])
        windows = -(-len(rows) // WINDOW)
        best, others = np.ones(windows, int), generator.integers(2, MAX_K + 1, windows)
        allowed = np.ones(len(self._database.starts), bool)
        if self._spoken is self._database:
            allowed = ~np.isin(self._database.recording, [recording, *self._held])
        free = self._admission(np.full(BOUNDS, np.nan), allowed)
        asked = hindsight(self._measured[rows], self._ranked, generator)[::WINDOW]
        steered = self._steered(asked, allowed, free)
        either = np.where(generator.random(windows) < 0.5, best, others)
        found = np.stack(
            [
                self._found(heard, speech, [free] * windows, best),
                self._found(heard, speech, [free] * windows, others),
                self._found(heard, speech, steered, either),
            ]
        )
        bounds = np.stack([bounds_of(admission.kept) for admission in steered])
        bounds[~speech] = np.nan
        return Walk(
            recording,
            rows,
            heard,
            found,
            np.stack([joined(self._shown(one)) for one in found]),
            np.repeat(bounds, WINDOW, axis=0)[: len(rows)],
        )

    def _steered(self, asked: np.ndarray, allowed: np.ndarray, free: Admission) -> list[Admission]:
        """What thresholds (w, 16) of windows admit; where that is too little to choose from, `free`."""
        steered: list[Admission] = []
        for number, bounds in enumerate(asked):
            if number and np.array_equal(bounds, asked[number - 1], equal_nan=True):
                steered.append(steered[-1])
                continue
            admission = self._admission(bounds, allowed)
            steered.append(admission if admission.sequences >= FEWEST else free)
        return steered

    def _admission(self, bounds: np.ndarray, allowed: np.ndarray) -> Admission:
        """What thresholds (16,) admit of the sequences that are allowed."""
        admission = self._controls.admit(constraints_of(bounds))
        mask = admission.mask & allowed[:, None]
        sequences = int(eligible(mask).any(axis=1).sum())
        return replace(admission, mask=mask, sequences=sequences)

    def _found(
        self, heard: np.ndarray, speech: np.ndarray, admissions: list[Admission], ks: np.ndarray
    ) -> np.ndarray:
        """(n,) rows of the motion that is found for sound (n, 28), or -1, of which w windows are speech."""
        pose, found = self._search.pose_of(self._rest), []
        lately: deque[tuple[int, int]] = deque(maxlen=LATELY // WINDOW)
        for window, (spoken, admission, k) in enumerate(zip(speech, admissions, ks, strict=True)):
            if not spoken:
                pose = self._search.pose_of(self._rest)
                found.append(np.full(WINDOW, -1))
                continue
            sound = self._search.audio_of(heard[WINDOW * window :][: AUDIO_OFFSETS[-1] + 1])
            match = self._search.find(pose, sound, admission.without(lately), int(k))
            assert match  # there are others
            first = self._search.row(match.sequence, match.frame)
            found.append(np.arange(first, first + WINDOW))
            pose = self._search.pose_at(first + WINDOW - 1)
            lately.appendleft((match.sequence, match.frame))
        return np.concatenate(found)[: len(heard)]

    def _shown(self, found: np.ndarray) -> np.ndarray:
        """(n, 17, 3) the motion of rows (n,) of the database, at rest where they are -1 [m]."""
        return np.where((found < 0)[:, None, None], self._rest, self._database.keypoints[found])
