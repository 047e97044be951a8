"""A Frechet distance without a network: how fast keypoints move, and where the hands are."""

from collections.abc import Sequence

import numpy as np

from gesture_bot.base.frames import FRAME_RATE
from gesture_bot.base.keypoints import INDEX, WRISTS
from gesture_bot.evaluate.frechet import half_distance, half_sums
from gesture_bot.evaluate.pieces import Piece
from gesture_bot.evaluate.resampling import Metric
from gesture_bot.evaluate.windows import STEP, WINDOW_FRAMES, sliding

MOVING = [INDEX["head"]] + [
    INDEX[f"{side}_{part}"] for side in ("left", "right") for part in ("elbow", "wrist", "index")
]

FEATURES = 3 * len(MOVING) + 3 * len(WRISTS)

_CONSTANT = 1e-6


def kinematic_features(keypoints: np.ndarray) -> np.ndarray:
    """Of each window of a motion: (n, 17, 3) -> (w, FEATURES).

    For the head, elbows, wrists and index-finger roots, the root mean squares of horizontal speed, vertical
    speed and acceleration, which are roots of the energies of Onuma et al. 2008 (Li et al. 2021, AI
    Choreographer, section 5.2.1, use these for FID_k); then the mean places of the wrists. [m/s, m/s2, m]
    """
    moving = keypoints[:, MOVING]
    velocity = sliding(np.diff(moving, axis=0) * FRAME_RATE, WINDOW_FRAMES - 1, STEP)
    gained = sliding(np.diff(moving, n=2, axis=0) * FRAME_RATE**2, WINDOW_FRAMES - 2, STEP)
    windows = len(range(0, len(keypoints) - WINDOW_FRAMES + 1, STEP))
    return np.concatenate(
        [
            np.sqrt((velocity[:windows, ..., :2] ** 2).sum(axis=-1).mean(axis=1)),
            np.sqrt((velocity[:windows, ..., 2] ** 2).mean(axis=1)),
            np.sqrt((gained[:windows] ** 2).sum(axis=-1).mean(axis=1)),
            sliding(keypoints[:, WRISTS], WINDOW_FRAMES, STEP).mean(axis=1).reshape(windows, -1),
        ],
        axis=1,
    )


def scaled_features(
    shown: Sequence[np.ndarray], recorded: Sequence[np.ndarray]
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """kinematic_features of motions shown and recorded, in deviations of the recorded ones."""
    people = [kinematic_features(motion) for motion in recorded]
    everything = np.concatenate(people)
    # Speeds and places have their own units: each counts by how much it varies among people.
    deviation = everything.std(axis=0) if len(everything) else np.ones(FEATURES)
    deviation = np.where(deviation > _CONSTANT, deviation, 1.0)
    return [kinematic_features(motion) / deviation for motion in shown], [one / deviation for one in people]


def _sums(pieces: Sequence[Piece]) -> np.ndarray:
    return half_sums(
        *scaled_features([piece.shown for piece in pieces], [piece.recorded for piece in pieces])
    )


KINEMATIC_DISTANCE = Metric("kinematic FD", "", _sums, half_distance(FEATURES), 2, "lower", biased=True)
