"""The search of MM22 word for word: what the fast one in search.py is tested against."""

import numpy as np

from gesture_bot.corpus.database import Database
from gesture_bot.matching.features import poses, sounds
from gesture_bot.matching.search import (
    POSITIONS,
    Match,
    Preselection,
    check_mask,
    check_queries,
    check_settings,
    eligible,
    ranks_of,
)


class Reference:
    """All features of a database, and the search through them.

    It takes 95 KB a sequence, and time in proportion to the whole database.
    """

    def __init__(self, database: Database) -> None:
        rows = (database.starts[:, None] + np.arange(POSITIONS)).ravel()
        self._poses, self._sounds = poses(database), sounds(database)
        self.pose_features = self._poses.at(rows).reshape(-1, POSITIONS, 96)
        self.audio_features = self._sounds.at(rows).reshape(-1, POSITIONS, 112)

    def find(
        self,
        pose_query: np.ndarray,
        audio_query: np.ndarray,
        mask: np.ndarray,
        k: int = 1,
        preselection: Preselection = "pose",
    ) -> Match | None:
        """See Search.find."""
        check_settings(k, preselection)
        check_queries(pose_query, audio_query)
        check_mask(mask, len(self.pose_features))
        pose_query, audio_query = np.asarray(pose_query, np.float64), np.asarray(audio_query, np.float64)
        allowed = eligible(mask)

        # In each sequence, the eligible frame nearest to the query; 0 is the query's own frame.
        distances = np.full(allowed.shape, np.inf)
        if preselection == "audio":
            distances[allowed] = self._sounds.distance(self.audio_features[allowed], audio_query)
        else:
            distances[allowed] = self._poses.distance(self.pose_features[allowed], pose_query)
        distances[distances == 0] = np.inf
        survivors = np.flatnonzero(np.isfinite(distances.min(axis=1)))
        if len(survivors) == 0:
            return None
        frames = distances.argmin(axis=1)[survivors]

        # The survivors' ranks by pose and by sound are added.
        pose = self._poses.distance(self.pose_features[survivors, frames], pose_query)
        audio = self._sounds.distance(self.audio_features[survivors, frames], audio_query)
        ranks = ranks_of(pose)
        if preselection != "pose_only":
            ranks += ranks_of(audio)

        winner = np.argsort(ranks, kind="stable")[min(k, len(survivors)) - 1]
        return Match(
            int(survivors[winner]),
            int(frames[winner]),
            float(pose[winner]),
            float(audio[winner]),
            len(survivors),
        )
