"""The systems of MM22's table 3: each shows motion to speech."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np
from tqdm import tqdm

from gesture_bot.base.frames import WINDOW, KeypointClip
from gesture_bot.corpus.database import Database
from gesture_bot.evaluate.pieces import Motion, Performance
from gesture_bot.matching.emotions import NEUTRAL
from gesture_bot.matching.search import Preselection
from gesture_bot.matching.selector import Selector
from gesture_bot.refine.model import RefinementModel
from gesture_bot.refine.offline import LEAD_IN, refined_windows
from gesture_bot.refine.streaming import NetworkRefiner
from gesture_bot.speech.streaming import SpeechFrame

SMOOTHED = "k-NN pose pre-selected, smoothing alone"
"""The system that others are compared with."""


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


def systems_of(database: Database, model: RefinementModel | None = None) -> list[System]:
    """The k-NN systems over a database, and the one with a network where there is one."""
    walk = lru_cache(partial(_walk, database, model))

    def shown(preselection: Preselection, kind: int, performances: tuple[Performance, ...]) -> list[Motion]:
        return [motions[kind] for motions in walk(preselection, performances)]

    systems = [
        System("k-NN pose only", "no", partial(shown, "pose_only", 0)),
        System("k-NN audio pre-selected", "no", partial(shown, "audio", 0)),
        System("k-NN pose pre-selected", "no", partial(shown, "pose", 0)),
        System(SMOOTHED, "Gaussian", partial(shown, "pose", 1)),
    ]
    if model is not None:
        systems.append(System("k-NN pose pre-selected + cGAN", "network", partial(shown, "pose", 2)))
    return systems


def _walk(
    database: Database,
    model: RefinementModel | None,
    preselection: Preselection,
    performances: Sequence[Performance],
) -> list[list[Motion]]:
    """Motion as found, as smoothed and, with a model, as refined, to each performance by itself."""
    title = f"k-NN, {preselection.replace('_', ' ')}"
    return [
        _shown(Selector(database, {}, NEUTRAL, preselection=preselection), model, performance)
        for performance in tqdm(performances, title, unit="recording", disable=None)
    ]


def _shown(selector: Selector, model: RefinementModel | None, performance: Performance) -> list[Motion]:
    frames = len(performance.features)
    heard = [
        SpeechFrame(index, *frame)
        for index, frame in enumerate(zip(performance.features, performance.speech, strict=True))
    ]
    kinds: list[dict[int, np.ndarray]] = [{} for _ in range(2 if model is None else 3)]
    network = model and NetworkRefiner(model, selector.hearing)
    seams: list[int] = []
    for window, smoothed in refined_windows(selector, heard, range(LEAD_IN + frames + WINDOW)):
        found = KeypointClip(window.start, window.keypoints)
        clips = [found, smoothed]
        if network:
            clips.append(network.push(found, window.source, window.kept))
        for made, clip in zip(kinds, clips, strict=True):
            made.update(enumerate(clip.keypoints, clip.start))
        seams = [seam for seam in seams if seam < window.start]
        # The way to rest goes on from where the hands are.
        if window.source == "speech":
            seams.append(window.start)
    begun = np.array(seams, int) - LEAD_IN
    shown = range(LEAD_IN, LEAD_IN + frames)
    return [Motion(np.stack([made[frame] for frame in shown]), begun) for made in kinds]
