"""The systems of MM22's table 3: each shows motion to speech."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np
from tqdm import tqdm

from gesture_bot.base.frames import WINDOW
from gesture_bot.corpus.database import Database
from gesture_bot.evaluate.pieces import Motion, Performance
from gesture_bot.matching.emotions import NEUTRAL
from gesture_bot.matching.search import Preselection
from gesture_bot.matching.selector import Selector
from gesture_bot.refine.offline import LEAD_IN, refined_windows
from gesture_bot.speech.streaming import SpeechFrame

SMOOTHED = "k-NN pose pre-selected, smoothing alone"
"""The system that others are compared with."""

Refine = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""A trained refinement: speech features (n, 28) and keypoints (n, 17, 3) [m] of windows as the search chose
them, one after another -> refined keypoints (n, 17, 3) [m]."""


@dataclass(frozen=True)
class System:
    """Something that shows motion to speech.

    Attributes:
        name: In tables.
        smoothed: Whether what the search chose was made smooth, and by what.
        show: From performances, of which it sees the speech alone, to a motion each.
    """

    name: str
    smoothed: str
    show: Callable[[tuple[Performance, ...]], list[Motion]]


def systems_of(database: Database, refine: Refine | None = None) -> list[System]:
    """The k-NN systems over a database, and the one with a network where there is one."""
    walk = lru_cache(partial(_walk, database))

    def found(preselection: Preselection, performances: tuple[Performance, ...]) -> list[Motion]:
        return [motion for motion, _ in walk(preselection, performances)]

    def smoothed(performances: tuple[Performance, ...]) -> list[Motion]:
        return [motion for _, motion in walk("pose", performances)]

    systems = [
        System("k-NN pose only", "no", partial(found, "pose_only")),
        System("k-NN audio pre-selected", "no", partial(found, "audio")),
        System("k-NN pose pre-selected", "no", partial(found, "pose")),
        System(SMOOTHED, "Gaussian", smoothed),
    ]
    if refine is not None:

        def refined(performances: tuple[Performance, ...]) -> list[Motion]:
            return [
                Motion(refine(performance.features, motion.keypoints), motion.seams)
                for performance, motion in zip(performances, found("pose", performances), strict=True)
            ]

        systems.append(System("k-NN pose pre-selected + cGAN", "network", refined))
    return systems


def _walk(
    database: Database, preselection: Preselection, performances: Sequence[Performance]
) -> list[tuple[Motion, Motion]]:
    """Motion as found and as smoothed, to each performance by itself."""
    title = f"k-NN, {preselection.replace('_', ' ')}"
    return [
        _shown(Selector(database, {}, NEUTRAL, preselection=preselection), performance)
        for performance in tqdm(performances, title, unit="recording", disable=None)
    ]


def _shown(selector: Selector, performance: Performance) -> tuple[Motion, Motion]:
    frames = len(performance.features)
    heard = [
        SpeechFrame(index, *frame)
        for index, frame in enumerate(zip(performance.features, performance.speech, strict=True))
    ]
    found: dict[int, np.ndarray] = {}
    smoothed: dict[int, np.ndarray] = {}
    seams: list[int] = []
    for window, clip in refined_windows(selector, heard, range(LEAD_IN + frames + WINDOW)):
        found.update(enumerate(window.keypoints, window.start))
        smoothed.update(enumerate(clip.keypoints, clip.start))
        seams = [seam for seam in seams if seam < window.start]
        # The way to rest goes on from where the hands are.
        if window.source == "speech":
            seams.append(window.start)
    begun = np.array(seams, int) - LEAD_IN
    shown = range(LEAD_IN, LEAD_IN + frames)
    as_found, as_smoothed = (np.stack([made[frame] for frame in shown]) for made in (found, smoothed))
    return Motion(as_found, begun), Motion(as_smoothed, begun)
