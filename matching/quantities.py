"""What the motion controls measure on every frame (MM22; the hand radius is RG22's)."""

from collections.abc import Callable
from typing import Literal

import numpy as np
from scipy.ndimage import uniform_filter1d

from gesture_bot.base.frames import FRAME_RATE, WINDOW
from gesture_bot.base.keypoints import INDEX
from gesture_bot.corpus.database import SEQUENCE, Database

Quantity = Literal["wrist_height", "wrist_speed", "wrist_asymmetry", "hand_radius"]

UNITS: dict[Quantity, str] = {
    "wrist_height": "m",
    "wrist_speed": "m/s",
    "wrist_asymmetry": "m",
    "hand_radius": "m",
}

_WRISTS = [INDEX["left_wrist"], INDEX["right_wrist"]]


def wrist_height(keypoints: np.ndarray) -> np.ndarray:
    """Height of each wrist over the pelvis: (n, 17, 3) -> (n, 2) left and right [m]."""
    return keypoints[:, _WRISTS, 2] - keypoints[:, INDEX["pelvis"], None, 2]


def wrist_speed(keypoints: np.ndarray) -> np.ndarray:
    """Speed of each wrist: (n, 17, 3) -> (n, 2) left and right [m/s].

    Central difference, averaged over the 8 frames around each frame. A control looks at the first and the
    last frame of a window alone; averaged, these two stand for the whole window.
    """
    velocity = np.gradient(keypoints[:, _WRISTS], 1 / FRAME_RATE, axis=0)
    return uniform_filter1d(np.linalg.norm(velocity, axis=-1), WINDOW, axis=0, mode="nearest")


def wrist_asymmetry(keypoints: np.ndarray) -> np.ndarray:
    """Difference of the two wrists' heights: (n, 17, 3) -> (n, 2) [m], the same number for left and right."""
    left, right = keypoints[:, _WRISTS, 2].T
    return np.repeat(np.abs(left - right)[:, None], 2, axis=1)


def hand_radius(keypoints: np.ndarray) -> np.ndarray:
    """Distance of each wrist from the pelvis's vertical axis: (n, 17, 3) -> (n, 2) left and right [m]."""
    across = keypoints[:, _WRISTS, :2] - keypoints[:, INDEX["pelvis"], None, :2]
    return np.linalg.norm(across, axis=-1)


MEASURES: dict[Quantity, Callable[[np.ndarray], np.ndarray]] = {
    "wrist_height": wrist_height,
    "wrist_speed": wrist_speed,
    "wrist_asymmetry": wrist_asymmetry,
    "hand_radius": hand_radius,
}


def measure(database: Database) -> dict[Quantity, np.ndarray]:
    """Every quantity on every frame of every sequence: (S, 64, 2) left and right.

    A speed is measured within its recording.
    """
    first_of_recording = np.flatnonzero(np.diff(database.recording, prepend=-1))
    recordings = np.split(database.keypoints.astype(np.float64), database.starts[first_of_recording][1:])
    rows = database.starts[:, None] + np.arange(SEQUENCE)
    return {
        quantity: np.concatenate([of(recording) for recording in recordings])[rows]
        for quantity, of in MEASURES.items()
    }
