"""The k-NN search of MM22 over a whole database: exact, and much faster than comparing everything."""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.frames import WINDOW
from gesture_bot.corpus.database import SEQUENCE, Database
from gesture_bot.matching.codes import BYTE, SHORT, FrameCodes, PoseCodes
from gesture_bot.matching.contest import Contest, Distances
from gesture_bot.matching.features import poses, sounds

Preselection = Literal["pose", "audio", "pose_only"]

PRESELECTIONS: tuple[str, ...] = get_args(Preselection)
"""Which distance picks the frame within a sequence; `pose_only` never looks at the sound (MM22 table 3)."""

MAX_K = 15
"""MM22 varies its gestures with k up to this."""

LARGEST = 1e6
"""No number of a query is larger [standard deviations]."""

POSITIONS = SEQUENCE - WINDOW + 1
"""Frames of a sequence at which a window can begin."""


@dataclass(frozen=True)
class Match:
    """The window that a search has found.

    Attributes:
        sequence: Index of its sequence in the database.
        frame: Its first frame, counted from the start of the sequence.
        pose_distance: Euclidean distance of the z-scored pose features.
        audio_distance: Cosine distance of the z-scored audio features.
        candidates: Sequences that had an eligible frame.
    """

    sequence: int
    frame: int
    pose_distance: float
    audio_distance: float
    candidates: int


def check_queries(pose_query: np.ndarray, audio_query: np.ndarray) -> None:
    """Raise an InvalidValueError where a query is not a feature of numbers up to LARGEST."""
    for name, query, numbers in ("pose", pose_query, 96), ("audio", audio_query, 112):
        if np.shape(query) != (numbers,):
            raise InvalidValueError(f"shape of the {name} query", np.shape(query), [f"({numbers},)"])
        if not np.abs(query).max() <= LARGEST:
            wrong = query[~(np.abs(query) <= LARGEST)]
            raise InvalidValueError(f"number in the {name} query", wrong[0], [f"-{LARGEST:g} to {LARGEST:g}"])


def check_mask(mask: np.ndarray, sequences: int) -> None:
    """Raise an InvalidValueError where a control mask has another shape than (S, 64)."""
    if np.shape(mask) != (sequences, SEQUENCE):
        raise InvalidValueError("shape of the control mask", np.shape(mask), [f"({sequences}, {SEQUENCE})"])


def check_settings(k: int, preselection: str) -> None:
    """Raise an InvalidValueError where k is not from 1 to 15, or the pre-selection is unknown."""
    if not 1 <= k <= MAX_K:
        raise InvalidValueError("k of the search", k, [f"1 to {MAX_K}"])
    if preselection not in PRESELECTIONS:
        raise InvalidValueError("pre-selection of the search", preselection, PRESELECTIONS)


def eligible(mask: np.ndarray) -> np.ndarray:
    """Where a window may begin: allowed at its first and its last frame, (S, 64) bool -> (S, 57) bool."""
    return mask[:, :POSITIONS] & mask[:, WINDOW - 1 :]


def ranks_of(distances: np.ndarray) -> np.ndarray:
    """The place of each number in rising order, from 0; ties in the order given."""
    ranks = np.empty(len(distances), np.int64)
    ranks[np.argsort(distances, kind="stable")] = np.arange(len(distances))
    return ranks


class Search:
    """A database made ready to be searched.

    The search compares codes of a byte or two a number, which bound every distance from both sides, and so
    every rank. Only sequences whose rank is open and matters are compared in full. What it finds is what
    reference.py finds, to the last bit.

    Args:
        database: Read where it is needed, so that a mapped file stays on the disk for the most part.
    """

    def __init__(self, database: Database) -> None:
        self._starts = database.starts
        self._poses, self._sounds = poses(database), sounds(database)
        self._pose_bytes = PoseCodes(self._poses, self._starts)
        self._pose_frames = FrameCodes(self._poses, self._starts, SHORT)
        self._sound_bytes = FrameCodes(self._sounds, self._starts, BYTE)
        self._sound_frames = FrameCodes(self._sounds, self._starts, SHORT)

    def row(self, sequence: int, frame: int) -> int:
        """Row of the database at which a frame of a sequence lies."""
        return int(self._starts[sequence]) + frame

    def pose_at(self, row: int) -> np.ndarray:
        """(96,) pose feature of a row of the database, with its real future."""
        return self._poses.at(np.array([row]))[0]

    def pose_of(self, keypoints: np.ndarray) -> np.ndarray:
        """(96,) pose feature of a pose (17, 3) [m] that is held."""
        return self._poses.of(keypoints.reshape(1, -1))

    def audio_of(self, features: np.ndarray) -> np.ndarray:
        """(112,) audio feature of the first of some frames (n, 28); the last one is held."""
        return self._sounds.of(features)

    def find(
        self,
        pose_query: np.ndarray,
        audio_query: np.ndarray,
        mask: np.ndarray,
        k: int = 1,
        preselection: Preselection = "pose",
    ) -> Match | None:
        """The window that goes on best from a pose with a sound.

        1. In each sequence, the eligible frame nearest to the query; the first of several. A distance of
           exactly 0 is the query's own frame, and skipped. A sequence with no frame left drops out.
        2. The survivors are ranked by pose and by audio, ties in the order of the sequences. The k-th
           smallest sum of the two ranks wins, ties again in that order. With fewer than k survivors, the
           one with the largest sum wins.

        Args:
            pose_query: (96,) pose feature of the last frame shown.
            audio_query: (112,) audio feature of the current frame.
            mask: (S, 64) bool control mask; a window needs it true at its first and its last frame.
            k: 1 for the best, up to 15.
            preselection: `pose` finds the frame of step 1 by pose, `audio` by audio; `pose_only` finds it
                by pose and ranks by pose alone.

        Returns:
            The match, or None where no sequence has an eligible frame but the query's own.

        Raises:
            InvalidValueError: See check_settings, check_queries and check_mask.
        """
        check_settings(k, preselection)
        check_queries(pose_query, audio_query)
        check_mask(mask, len(self._starts))
        pose, audio = (
            Distances(stream, np.ascontiguousarray(query, np.float64), len(self._starts))
            for stream, query in ((self._poses, pose_query), (self._sounds, audio_query))
        )
        ranked = {"pose": [pose, audio], "audio": [audio, pose], "pose_only": [pose]}[preselection]
        codes = self._pose_bytes, self._pose_frames, self._sound_bytes, self._sound_frames
        contest = Contest(self._starts, mask, k, [one.table for one in codes], ranked, pose, audio)
        candidates = contest.candidates
        if candidates == 0:
            return None
        winner = contest.winner(min(k, candidates))
        frame = contest.frame(winner)
        if audio not in ranked:
            row = np.array([self.row(winner, frame)])
            audio.know(np.array([winner]), audio.exact(row))
        self._poses.release()  # and the sounds, which lie in the same file
        return Match(winner, frame, float(pose.near[winner]), float(audio.near[winner]), candidates)
