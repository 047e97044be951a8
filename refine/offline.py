"""Refined motion for speech that is known as a whole, without waiting for the clock."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.frames import FRAME_RATE, KeypointClip, frame_time
from gesture_bot.matching.plan import Window
from gesture_bot.matching.selector import Selector
from gesture_bot.refine.model import RefinementModel
from gesture_bot.refine.smoothing import WindowSmoother
from gesture_bot.refine.streaming import NetworkRefiner
from gesture_bot.speech.streaming import SpeechFrame

LEAD_IN = 2 * FRAME_RATE
"""Frames of rest before the sound, in which the first gesture prepares."""


@dataclass(frozen=True)
class SpokenMotion:
    """What the selector made of speech, and what became of it.

    Attributes:
        windows: Those that the search chose.
        refined: The motion from the first window of any kind to the last.
        spoken: (n,) bool: the frames of it that come from `windows`.
    """

    windows: list[Window]
    refined: KeypointClip
    spoken: np.ndarray


def spoken_motion(
    selector: Selector, speech: Sequence[SpeechFrame], model: RefinementModel | None = None
) -> SpokenMotion:
    """Walk speech through search and refinement, up to its end; for the arguments see refined_windows.

    Raises:
        InvalidValueError: There is no speech.
    """
    refined: dict[int, np.ndarray] = {}
    spoken: dict[int, bool] = {}
    windows = []
    for window, clip in refined_windows(selector, speech, range(LEAD_IN + len(speech)), model):
        refined.update(enumerate(clip.keypoints, clip.start))
        spoken.update(dict.fromkeys(range(window.start, window.stop), window.source == "speech"))
        if window.source == "speech":
            windows.append(window)
    if not windows:
        raise InvalidValueError("there is no speech to make motion for")
    frames = range(min(spoken), max(spoken) + 1)
    return SpokenMotion(
        windows,
        KeypointClip(frames.start, np.stack([refined[frame] for frame in frames])),
        np.array([spoken[frame] for frame in frames]),
    )


def refined_windows(
    selector: Selector,
    speech: Iterable[SpeechFrame],
    frames: Iterable[int],
    model: RefinementModel | None = None,
) -> Iterator[tuple[Window, KeypointClip]]:
    """Walk speech through search and refinement, as the nodes do.

    Args:
        selector: Chooses windows; fresh.
        speech: Its frames, the first of which is heard in frame LEAD_IN; see speech.streaming.
        frames: The frames at which the selector plans, from 0 on.
        model: The network that refines; without one, windows are smoothed.

    Yields:
        Each window as it was chosen, and the refined frames that replace all from their first on.
    """
    for heard in speech:
        frame = LEAD_IN + heard.index
        selector.hearing.add_features(frame, heard.features, heard.speech)
        for beat in heard.beats:
            selector.hearing.add_beat(frame_time(frame) + beat)
    smoother, network = WindowSmoother(), model and NetworkRefiner(model, selector.hearing)
    for frame in frames:
        for window in selector.plan(frame_time(frame)):
            clip = KeypointClip(window.start, window.keypoints)
            yield (
                window,
                network.push(clip, window.source, window.kept) if network else smoother.push(clip),
            )
