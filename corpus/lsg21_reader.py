"""The data set of LSG21 (Habibie et al., IVA 2021): six speakers on video, and the 3D poses seen in it.

Its files SPEAKER/train_SPEAKER_noduplication_data.npz hold clips of 64 frames that do not overlap; those
without `noduplication` hold the same frames again and again. A clip is a take of its own: nothing says what
followed it.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from gesture_bot.base.errors import FileFormatError
from gesture_bot.corpus.npz import array_names, load_array
from gesture_bot.corpus.precomputed import Sound, features_like_ours
from gesture_bot.corpus.sources import Take
from gesture_bot.speech.features import COEFFICIENTS, FEATURES, speech_features

KIND = "LSG21's data set (.npz with the arrays body, and wav or mfcc)"

RATE = 15
"""Frames a second."""

_FINGERS = ("index", "middle", "little", "ring", "thumb")
_HAND = (
    "hand_root",
    *(f"{finger}_{joint}" for finger in _FINGERS for joint in range(3)),
    *(f"{finger}_3" for finger in _FINGERS),
)
JOINTS = (
    "head_top", "neck",
    "right_shoulder", "right_elbow", "right_wrist", "left_shoulder", "left_elbow", "left_wrist",
    "right_hip", "left_hip", "pelvis", "spine", "head",
    *(f"right_{joint}" for joint in _HAND), *(f"left_{joint}" for joint in _HAND),
)  # fmt: skip
"""The 55 joints in the order and with the names of the data set's README."""


def fits(path: Path) -> bool:
    """Whether it is an .npz file with an array `body`."""
    return "body" in array_names(path)


def read(path: Path) -> Iterator[Take]:
    """The clips of a file, in its order.

    Features are computed from the samples of each clip or, where the file has none, its MFCC are put on our
    scale; see precomputed.py.

    Raises:
        FileFormatError: An array is missing or damaged, or does not have the shape of the data set.
    """
    sound = "wav" if "wav" in array_names(path) else "mfcc"
    body, heard = load_array(path, "body"), load_array(path, sound)
    if body.ndim != 3 or body.shape[2] != 3 * len(JOINTS):
        raise FileFormatError(f"{path}: shape of body", body.shape, [f"(n, 64, {3 * len(JOINTS)})"])
    if sound == "mfcc":
        fitting, wanted = heard.shape == (*body.shape[:2], FEATURES), f"{(*body.shape[:2], FEATURES)}"
    else:
        fitting, wanted = heard.ndim == 2 and len(heard) == len(body), f"({len(body)}, samples)"
    if not fitting:
        raise FileFormatError(f"{path}: shape of {sound}", heard.shape, [wanted])
    if len(body) == 0:
        raise FileFormatError(f"{path} holds no clips")
    features = _from_mfcc(heard) if sound == "mfcc" else _from_samples(heard)
    for number, (clip, vectors) in enumerate(zip(body, features, strict=True)):
        yield Take(f"{path.stem} {number}", JOINTS, _positions(clip), RATE, vectors)


def _positions(clip: np.ndarray) -> np.ndarray:
    """(n, 165) -> (n, 55, 3) [m]. The file places each hand by its root, which is the wrist."""
    positions = clip.reshape(len(clip), 3, len(JOINTS)).swapaxes(1, 2).astype(np.float64)
    for side in ("right", "left"):
        root = JOINTS.index(f"{side}_hand_root")
        hand = positions[:, root : root + len(_HAND)]
        hand += positions[:, [JOINTS.index(f"{side}_wrist")]] - hand[:, :1]
    return positions


def _from_samples(clips: np.ndarray) -> Iterator[np.ndarray]:
    """Features of (n, samples) at audio.SAMPLE_RATE, integers or full scale 1."""
    loudest = max(1.0, float(clips.max(initial=0)), -float(clips.min(initial=0)))
    return (speech_features(clip / loudest) for clip in clips)


def _from_mfcc(clips: np.ndarray) -> list[np.ndarray]:
    """Features of (n, frames, 28): 13 MFCC, log(1 + mean power), and the derivatives of these 14."""
    numbers = clips.astype(np.float64)
    return features_like_ours(
        [Sound(clip[:, :COEFFICIENTS], np.expm1(clip[:, COEFFICIENTS]), RATE) for clip in numbers]
    )
