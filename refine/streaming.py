"""Streaming refinement by a trained network: windows of 64 frames, every 8 as they are chosen."""

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np

from gesture_bot.base.frames import WINDOW, KeypointClip
from gesture_bot.base.keypoints import KEYPOINTS, bone_lengths, with_bone_lengths
from gesture_bot.corpus.database import SEQUENCE
from gesture_bot.matching.controls import Constraint
from gesture_bot.matching.hearing import Hearing
from gesture_bot.refine.bounds import BOUNDS, bounds_of
from gesture_bot.refine.model import RefinementModel
from gesture_bot.refine.smoothing import HISTORY, WindowSmoother, gaussian
from gesture_bot.speech.features import FEATURES

Refined = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""From windows of features, keypoints and bounds to refined keypoints; see Card.refined."""

SIGMA = 1.25
"""Standard deviation of the Gaussian over what the network makes [frames].

With less, the noise that it adds takes beats from the motion (PMB).
"""


def refined_motion(
    refined: Refined, features: np.ndarray, keypoints: np.ndarray, bounds: np.ndarray
) -> np.ndarray:
    """What NetworkRefiner ends up with for speech whose windows of 8 frames are all known, all at once.

    Args:
        refined: See Refined.
        features: (n, 28) speech features.
        keypoints: (n, 17, 3) what the search found for them, joined [m], pelvis frame; see WindowJoiner.
        bounds: (n, 16) thresholds that the search kept for it; see bounds.bounds_of.

    Returns:
        (n, 17, 3) [m], with the bone lengths of `keypoints`. Before the first frame, it counts as held.
    """
    stops = np.array([*range(WINDOW, len(keypoints), WINDOW), len(keypoints)])
    rows = _window_rows(stops)
    windows = refined(features[rows], keypoints[rows], bounds[rows])
    made = np.concatenate(
        [window[begin - stop :] for window, (begin, stop) in zip(windows, pairwise([0, *stops]), strict=True)]
    )
    return with_bone_lengths(gaussian(made, SIGMA), bone_lengths(keypoints))


class NetworkRefiner:
    """Refines windows as they come: those of speech by the network, rest and semantic gestures by smoothing.

    With each 8 frames that are new, the network sees the 64 up to their end: it looks no further ahead than
    the search has chosen. The motion changes over from one to the other within a window.

    Args:
        model: The network.
        hearing: Knows the speech that the windows go with.
    """

    def __init__(self, model: RefinementModel, hearing: Hearing) -> None:
        self._model, self._hearing = model, hearing
        self._smoother = WindowSmoother()
        self._start = 0
        self._found = self._made = np.empty((0, len(KEYPOINTS), 3))
        self._sound, self._bounds = np.empty((0, FEATURES)), np.empty((0, BOUNDS))
        self._share = np.empty(0)

    def push(self, clip: KeypointClip, source: str, kept: Sequence[Constraint] = ()) -> KeypointClip:
        """Take the next clip; it replaces everything from its first frame on.

        Args:
            clip: See WindowJoiner.push.
            source: Of the window; see plan.Window.
            kept: Bounds that the search kept for it.

        Returns:
            As WindowSmoother.push: the last 4 frames come again, changed, with the next clip.

        Raises:
            InvalidValueError: See WindowJoiner.push.
        """
        smooth = self._smoother.push(clip)
        joiner, new = self._smoother.joiner, slice(-len(clip.keypoints), None)
        found = with_bone_lengths(joiner.motion[new], joiner.lengths[new])
        begin = self._append(KeypointClip(clip.start, found), source, bounds_of(kept))
        for first in range(begin, len(self._found), WINDOW):
            stop = min(first + WINDOW, len(self._found))
            rows = _window_rows(np.array([stop]))
            window = self._model.refined(self._sound[rows], self._found[rows], self._bounds[rows])[0]
            self._made[first:stop] = window[first - stop :]
        emitted = slice(-len(smooth.keypoints), None)
        share = self._share[emitted, None, None]
        keypoints = (1 - share) * smooth.keypoints + share * gaussian(self._made, SIGMA)[emitted]
        return KeypointClip(smooth.start, with_bone_lengths(keypoints, bone_lengths(smooth.keypoints)))

    def _append(self, clip: KeypointClip, source: str, bounds: np.ndarray) -> int:
        """Put a clip in place of all from its first frame on; the index of that frame."""
        frames = np.arange(max(self._start, clip.start - HISTORY - SEQUENCE), clip.start)
        if not len(self._found):
            frames = frames[:0]
        # The last frame is held over a gap.
        before = np.minimum(frames - self._start, len(self._found) - 1)
        shares = self._share[before]
        step = (1 if source == "speech" else -1) / WINDOW
        last = shares[-1] if len(shares) else 0.0
        coming = np.clip(last + step * np.arange(1, len(clip.keypoints) + 1), 0, 1)
        self._found = np.concatenate([self._found[before], clip.keypoints])
        self._made = np.concatenate([self._made[before], clip.keypoints])
        self._sound = np.concatenate([self._sound[before], self._hearing.features(clip.start, clip.stop)])
        self._bounds = np.concatenate([self._bounds[before], np.tile(bounds, (len(clip.keypoints), 1))])
        self._share = np.concatenate([shares, coming])
        self._start = clip.stop - len(self._found)
        return len(before)


def _window_rows(stops: np.ndarray) -> np.ndarray:
    """(w, 64) rows of the windows that end before some rows (w,); the first row is held before it."""
    return np.maximum(stops[:, None] + np.arange(-SEQUENCE, 0), 0)
