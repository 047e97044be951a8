"""What the motion controls measure on every frame (MM22; the hand radius is RG22's)."""

from collections.abc import Callable
from typing import Literal, get_args

import numpy as np

from gesture_bot.base.frames import FRAME_RATE, WINDOW
from gesture_bot.base.keypoints import INDEX, WRISTS
from gesture_bot.base.vectors import length
from gesture_bot.corpus.database import SEQUENCE, Database

Quantity = Literal["wrist_height", "wrist_speed", "wrist_asymmetry", "hand_radius", "hand_span"]

QUANTITIES: tuple[Quantity, ...] = get_args(Quantity)

TWO_HANDED: tuple[Quantity, ...] = ("wrist_asymmetry", "hand_span")
"""Quantities that both hands have together."""

UNITS: dict[Quantity, str] = {**dict.fromkeys(QUANTITIES, "m"), "wrist_speed": "m/s"}


_REACH = WINDOW // 2  # frames before and after a frame that its speed looks at
_BLOCK = 1 << 15  # frames measured at once: a long database is not copied as a whole


def wrist_height(keypoints: np.ndarray) -> np.ndarray:
    """Height of each wrist over the pelvis: (n, 17, 3) -> (n, 2) left and right [m]."""
    return keypoints[:, WRISTS, 2] - keypoints[:, INDEX["pelvis"], None, 2]


def wrist_speed(keypoints: np.ndarray, stretches: np.ndarray | None = None) -> np.ndarray:
    """Speed of each wrist: (n, 17, 3) -> (n, 2) left and right [m/s].

    The length of the wrist's path from 4 frames before to 4 frames after, by its time. A control looks at the
    first and the last frame of a window alone; averaged, these two stand for the whole window.

    Args:
        keypoints: Frames that follow each other.
        stretches: (n,) rising numbers, where they do not all: frames with the same number follow each other.
    """
    frames = np.arange(len(keypoints))
    if stretches is None:
        stretches = np.zeros(len(keypoints))
    first = np.searchsorted(stretches, stretches, "left")
    last = np.searchsorted(stretches, stretches, "right") - 1
    begin, end = np.maximum(frames - _REACH, first), np.minimum(frames + _REACH, last)
    steps = np.linalg.norm(np.diff(keypoints[:, WRISTS], axis=0), axis=-1)
    path = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    return (path[end] - path[begin]) * FRAME_RATE / np.maximum(end - begin, 1)[:, None]


def wrist_asymmetry(keypoints: np.ndarray) -> np.ndarray:
    """Difference of the two wrists' heights: (n, 17, 3) -> (n, 1) [m]."""
    left, right = WRISTS
    return np.abs(keypoints[:, left, 2:] - keypoints[:, right, 2:])


def hand_radius(keypoints: np.ndarray) -> np.ndarray:
    """Distance of each wrist from the pelvis's vertical axis: (n, 17, 3) -> (n, 2) left and right [m]."""
    across = keypoints[:, WRISTS, :2] - keypoints[:, INDEX["pelvis"], None, :2]
    return np.linalg.norm(across, axis=-1)


def hand_span(keypoints: np.ndarray) -> np.ndarray:
    """Distance between the wrists: (n, 17, 3) -> (n, 1) [m]."""
    left, right = WRISTS
    return length(keypoints[:, left] - keypoints[:, right])


MEASURES: dict[Quantity, Callable[[np.ndarray], np.ndarray]] = {
    "wrist_height": wrist_height,
    "wrist_speed": wrist_speed,
    "wrist_asymmetry": wrist_asymmetry,
    "hand_radius": hand_radius,
    "hand_span": hand_span,
}
"""Each quantity of a clip (n, 17, 3): (n, 2) left and right, or (n, 1) where it is TWO_HANDED."""


def measure(database: Database) -> dict[Quantity, np.ndarray]:
    """Every quantity on every frame of a database: (2, N) left and right, or (1, N), float32."""
    frames = len(database.keypoints)
    stretches = _stretches(database)
    hands = {quantity: 1 if quantity in TWO_HANDED else 2 for quantity in QUANTITIES}
    measured = {quantity: np.empty((hands[quantity], frames), np.float32) for quantity in QUANTITIES}
    for begin in range(0, frames, _BLOCK):
        end = min(begin + _BLOCK, frames)
        seen = slice(max(0, begin - _REACH), end + _REACH)
        keypoints = database.keypoints[seen].astype(np.float64)
        for quantity, of in MEASURES.items():
            values = wrist_speed(keypoints, stretches[seen]) if quantity == "wrist_speed" else of(keypoints)
            measured[quantity][:, begin:end] = values[begin - seen.start :][: end - begin].T
    return measured


def _stretches(database: Database) -> np.ndarray:
    """(N,) int32: numbers that rise where a frame does not follow the one before."""
    starts = database.starts
    # Sequences of one recording that leave a gap were stored alone; see recordings.build_database.
    alone = np.diff(starts, prepend=starts[0]) > SEQUENCE
    rises = np.zeros(len(database.keypoints), np.int32)
    rises[starts[alone | (np.diff(database.recording, prepend=-1) != 0)]] = 1
    return np.cumsum(rises, dtype=np.int32)
