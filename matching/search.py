"""The k-NN search of MM22 over a whole database, exact."""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.frames import WINDOW
from gesture_bot.corpus.database import SEQUENCE, Database
from gesture_bot.matching.features import (
    AUDIO_OFFSETS,
    POSE_OFFSETS,
    ZScore,
    audio_frames,
    pose_frames,
    stack,
)

Preselection = Literal["pose", "audio", "pose_only"]

PRESELECTIONS: tuple[str, ...] = get_args(Preselection)
"""Which distance picks the frame within a sequence; `pose_only` never looks at the sound (MM22 table 3)."""

MAX_K = 15
"""MM22 varies its gestures with k up to this."""

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


def check_settings(k: int, preselection: str) -> None:
    """Raise an InvalidValueError where k is not from 1 to 15, or the pre-selection is unknown."""
    if not 1 <= k <= MAX_K:
        raise InvalidValueError("k of the search", k, [f"1 to {MAX_K}"])
    if preselection not in PRESELECTIONS:
        raise InvalidValueError("pre-selection of the search", preselection, PRESELECTIONS)


def eligible(mask: np.ndarray) -> np.ndarray:
    """Where a window may begin: allowed at its first and its last frame, (S, 64) bool -> (S, 57) bool."""
    return mask[:, :POSITIONS] & mask[:, WINDOW - 1 :]


class Search:
    """A database made ready to be searched.

    Every z-scored frame is stored once, in double precision; the stacked features are gathered for the
    eligible windows alone.
    """

    def __init__(self, database: Database) -> None:
        poses, sounds = pose_frames(database.keypoints), audio_frames(database.features)
        self._pose_score, self._audio_score = ZScore.of(poses), ZScore.of(sounds)
        self._poses, self._sounds = self._pose_score(poses), self._audio_score(sounds)
        self._rows = database.starts[:, None] + np.arange(POSITIONS)

    def row(self, sequence: int, frame: int) -> int:
        """Row of the database at which a frame of a sequence lies."""
        return int(self._rows[sequence, 0]) + frame

    def pose_at(self, row: int) -> np.ndarray:
        """(96,) pose feature of a row of the database, with its real future."""
        return stack(self._poses, np.array([row]), POSE_OFFSETS)[0]

    def pose_of(self, keypoints: np.ndarray) -> np.ndarray:
        """(96,) pose feature of a pose (17, 3) [m] that is held."""
        frames = self._pose_score(pose_frames(keypoints[None]))
        return stack(frames, np.zeros(1, np.int64), POSE_OFFSETS)[0]

    def audio_of(self, features: np.ndarray) -> np.ndarray:
        """(112,) audio feature of the first of some frames (n, 28); the last one is held."""
        frames = self._audio_score(audio_frames(features))
        return stack(frames, np.zeros(1, np.int64), AUDIO_OFFSETS)[0]

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
            The match, or None where no sequence has an eligible frame.

        Raises:
            InvalidValueError: See check_settings.
        """
        check_settings(k, preselection)
        allowed = eligible(mask)
        distances = np.full(allowed.shape, np.inf)
        if preselection == "audio":
            distances[allowed] = self._audio_distance(self._rows[allowed], audio_query)
        else:
            distances[allowed] = self._pose_distance(self._rows[allowed], pose_query)
        distances[distances == 0] = np.inf
        frames = distances.argmin(axis=1)
        survivors = np.flatnonzero(np.isfinite(distances.min(axis=1)))
        if len(survivors) == 0:
            return None

        rows = self._rows[survivors, frames[survivors]]
        pose, audio = self._pose_distance(rows, pose_query), self._audio_distance(rows, audio_query)
        ranks = ranks_of(pose) if preselection == "pose_only" else ranks_of(pose) + ranks_of(audio)
        chosen = np.argsort(ranks, kind="stable")[min(k, len(survivors)) - 1]
        sequence = int(survivors[chosen])
        return Match(
            sequence, int(frames[sequence]), float(pose[chosen]), float(audio[chosen]), len(survivors)
        )

    def _pose_distance(self, rows: np.ndarray, query: np.ndarray) -> np.ndarray:
        differences = stack(self._poses, rows, POSE_OFFSETS)
        differences -= query
        return _norm(differences)

    def _audio_distance(self, rows: np.ndarray, query: np.ndarray) -> np.ndarray:
        """Cosine distance, as half the squared distance of unit vectors: exactly 0 between equal vectors."""
        features = _unit(stack(self._sounds, rows, AUDIO_OFFSETS))
        return _norm(features - _unit(query[None])) ** 2 / 2


def _norm(vectors: np.ndarray) -> np.ndarray:
    """Length of each row. Equal rows give equal lengths to the last bit, which a matrix product would not."""
    return np.sqrt(np.einsum("ij,ij->i", vectors, vectors))


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(_norm(vectors), 1e-12)[:, None]


def ranks_of(distances: np.ndarray) -> np.ndarray:
    """The place of each number in rising order, from 0; ties in the order given."""
    ranks = np.empty(len(distances), np.int64)
    ranks[np.argsort(distances, kind="stable")] = np.arange(len(distances))
    return ranks
