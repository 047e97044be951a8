"""Recorded motion shaped by an emotion: faster or slower, larger or smaller (Amaya et al. 1996)."""

import numpy as np

from gesture_bot.base.frames import WINDOW
from gesture_bot.base.keypoints import BONES, KEYPOINTS, bone_lengths, with_bone_lengths
from gesture_bot.base.vectors import length, unit
from gesture_bot.corpus.database import LOOKAHEAD

TEMPO = 0.5, LOOKAHEAD / (WINDOW - 1)
"""Slowest and fastest: a window must end within the real future of its sequence."""

AMPLITUDE = 0.3, 1.5
"""Smallest and largest: further from rest, arms would bend where they cannot."""

_ARMS = [
    (parent, child)
    for parent, child in BONES
    if KEYPOINTS[child].endswith(("elbow", "wrist", "index", "little"))
]


def played(keypoints: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Frames of a recording, also from between two of them: (m, 17, 3) -> (n, 17, 3) float64 [m].

    Poses between two frames have the bones of the earlier one.

    Args:
        keypoints: The recording.
        rows: (n,) its rows that are shown, one after another; fractions lie between two.
    """
    before = np.floor(rows).astype(np.int64)
    share = (rows - before)[:, None, None]
    earlier = keypoints[before].astype(np.float64)
    if not share.any():
        return earlier
    later = keypoints[before + 1].astype(np.float64)
    return with_bone_lengths(earlier + share * (later - earlier), bone_lengths(earlier))


def enlarged(keypoints: np.ndarray, amplitude: np.ndarray, rest: np.ndarray) -> np.ndarray:
    """Poses whose arms are further from rest, or nearer to it; the bones keep their lengths.

    Args:
        keypoints: (n, 17, 3) poses [m].
        amplitude: (n,) how far the bones' directions go from those at rest, 1 as they do; see AMPLITUDE.
        rest: (17, 3) the pose at rest [m].
    """
    if (amplitude == 1).all():
        return keypoints
    out = keypoints.copy()
    for parent, child in _ARMS:
        bone = keypoints[:, child] - keypoints[:, parent]
        at_rest = unit(rest[child] - rest[parent])
        direction = unit(at_rest + amplitude[:, None] * (unit(bone) - at_rest))
        out[:, child] = out[:, parent] + length(bone) * direction
    return out
