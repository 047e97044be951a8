"""Keypoints of somebody who gestures while speaking, from the stressed words of what is said."""

from collections.abc import Sequence

import numpy as np

from gesture_bot.base.frames import FRAME_RATE
from gesture_bot.corpus.body import Posture, pose
from gesture_bot.corpus.gestures import plan_gestures, rest_state
from gesture_bot.corpus.movement import path, sway
from gesture_bot.corpus.styles import Style

HAND_SWAY = np.array([0.012, 0.012, 0.012, 0.10, 0.08])
TORSO_SWAY = np.array([0.020, 0.015, 0.030])
HEAD_SWAY = np.array([0.030, 0.040, 0.060])
"""Of hands [m, m, m, rad, rad], torso and head [rad]; see corpus/body.py."""


def gesture(
    sentences: Sequence[Sequence[float]], frames: int, style: Style, generator: np.random.Generator
) -> np.ndarray:
    """Compose the motion of one recording.

    Args:
        sentences: For each sentence, the moments of its stressed syllables that may carry a stroke [s].
        frames: Length of the recording.
        style: How to move.
        generator: Source of every choice.

    Returns:
        (frames, 17, 3) keypoints [m], pelvis frame.
    """
    times = np.arange(frames) / FRAME_RATE
    plan = plan_gestures(sentences, frames / FRAME_RATE, style, generator)
    rest, still = rest_state(style), np.zeros(3)
    posture = Posture(
        left=path(times, rest, plan.left) + sway(times, HAND_SWAY, generator),
        right=path(times, rest, plan.right) + sway(times, HAND_SWAY, generator),
        torso=(0.0, style.lean, 0.0) + path(times, still, plan.torso) + sway(times, TORSO_SWAY, generator),
        head=(0.0, style.head, 0.0) + path(times, still, plan.head) + sway(times, HEAD_SWAY, generator),
        elbows=style.elbows,
    )
    return pose(posture)
