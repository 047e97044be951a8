"""Refined motion for speech that is known as a whole, without waiting for the clock."""

from collections.abc import Iterable, Iterator

import numpy as np

from gesture_bot.base.frames import FRAME_RATE, KeypointClip, frame_time
from gesture_bot.matching.plan import Window
from gesture_bot.matching.selector import Selector
from gesture_bot.refine.smoothing import WindowSmoother

LEAD_IN = 2 * FRAME_RATE
"""Frames of rest before the sound, in which the first gesture prepares."""


def refined_windows(
    selector: Selector, features: np.ndarray, speech: np.ndarray, frames: Iterable[int]
) -> Iterator[tuple[Window, KeypointClip]]:
    """Walk speech through search and refinement, as the nodes do.

    Args:
        selector: Chooses windows; fresh.
        features: (n, 28) speech features, 15 frames a second; the first is that of frame LEAD_IN.
        speech: (n,) bool: in which of these frames somebody speaks; see speech.activity.
        frames: The frames at which the selector plans, from 0 on.

    Yields:
        Each window as it was chosen, and the refined frames that replace all from their first on.
    """
    for frame, (vector, speaks) in enumerate(zip(features, speech, strict=True), LEAD_IN):
        selector.add_features(frame, vector, bool(speaks))
    smoother = WindowSmoother()
    for frame in frames:
        for window in selector.plan(frame_time(frame)):
            yield window, smoother.push(KeypointClip(window.start, window.keypoints))
