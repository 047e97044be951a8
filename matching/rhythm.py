"""Motion on the beats of speech (RG22): a window is played a little faster and slower, so that beats meet.

RG22 learns blocks of motion between beats and scales each in time. Recorded windows have beats of their own;
they are moved onto those of the speech.
"""

import numpy as np

from gesture_bot.base.frames import FRAME_RATE
from gesture_bot.base.keypoints import WRISTS

STRETCH = 0.25
"""A window is played at most by this share faster or slower than at its tempo, at every moment."""

LEAST_BRAKING = 1.0
"""Hands that brake less make no beat [m/s2]: what trembles is no gesture."""

BEFORE, AFTER = 2, 2
"""Frames before and after a moment without which no beat can be told there."""

NEAR = 2.0
"""Beats that are farther apart are no pair [frames]."""

_EFFORT = 0.1
"""A stretch of STRETCH is worth a beat that comes so much nearer [frames]."""


_RATES = np.linspace(-STRETCH, STRETCH, 11)
_WARPS = np.array(
    [(mean, slope) for mean in _RATES for slope in _RATES if abs(mean) + abs(slope) < 1.01 * STRETCH]
)
_WARPS = _WARPS[np.argsort(np.abs(_WARPS).sum(axis=1), kind="stable")]  # the plainest first


def motion_beats(keypoints: np.ndarray) -> np.ndarray:
    """When the hands brake hardest: the local minima of the change of their speed.

    So RG22's "local minima of joint deceleration" are read here; the speed is the mean of both wrists.

    Args:
        keypoints: (n, 17, 3) consecutive frames [m].

    Returns:
        (b,) rising moments [frames from the first], from BEFORE - 0.5 to n - AFTER - 0.5.
    """
    if len(keypoints) < 1 + BEFORE + AFTER:
        return np.zeros(0)
    speed = np.linalg.norm(np.diff(keypoints[:, WRISTS], axis=0), axis=-1).mean(axis=-1) * FRAME_RATE
    gained = np.diff(speed) * FRAME_RATE  # [m/s2], of the frames from the second on
    before, here, after = gained[:-2], gained[1:-1], gained[2:]
    beats = np.flatnonzero((here < before) & (here <= after) & (here < -LEAST_BRAKING))
    before, here, after = before[beats], here[beats], after[beats]
    # The lowest point of the parabola through the three.
    return beats + 2 + (before - after) / (2 * (before - 2 * here + after))


def aligned(moves: np.ndarray, beats: np.ndarray, frames: int, tempo: float) -> np.ndarray:
    """Which frames of a recording to show, so that its beats come near those of speech.

    The rate changes evenly from the first frame to the last, and stays within STRETCH of the tempo. Of all
    such warps, a grid is tried.

    Args:
        moves: (m,) beats of the motion [frames of the recording from the first shown].
        beats: (b,) beats of the speech [frames from the first shown].
        frames: How many to show.
        tempo: Frames of the recording to a frame, where nothing is to be aligned.

    Returns:
        (frames,) rising from 0.
    """
    mean, slope = _WARPS[..., None].transpose(1, 0, 2)

    def shown(moments: np.ndarray) -> np.ndarray:
        """(w, n) what each warp shows at moments (n,)."""
        return tempo * ((1 + mean - slope) * moments + slope * moments**2 / frames)

    beats = beats[(beats >= 0) & (beats <= frames - 0.5)]
    if not len(moves) or not len(beats):
        return tempo * np.arange(frames)
    apart = np.abs(shown(beats)[..., None] - moves).min(axis=-1) / tempo
    worth = np.maximum(0, NEAR - apart).sum(axis=1) - _EFFORT * np.abs(_WARPS).sum(axis=1) / STRETCH
    return shown(np.arange(frames))[worth.argmax()]
