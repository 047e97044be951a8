"""Finding frames where tracking failed, mending short gaps, and cutting long ones out."""

from collections import Counter
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import binary_closing, find_objects, label

from gesture_bot.corpus.one_body import ARMS, arm_bones

FASTEST = 6.0
"""Elbows and wrists that move faster than this relative to the pelvis have jumped [m/s]."""

STRETCH = (0.4, 2.5)
"""An upper arm or forearm outside of this range of its median length is broken. It is wide, as a camera alone
sees bones that point at it shortened."""

LONGEST_GAP = 0.2
"""Gaps up to this are mended, and good frames between two bad ones are only trusted for longer [s]."""

REASONS = ("lost", "broken", "jumped")
"""Why a frame is bad: tracking is lost, an arm bone is broken, an arm has jumped."""

_ELBOWS_AND_WRISTS = [keypoint for arm in ARMS for keypoint in arm[1:]]


@dataclass(frozen=True)
class Cleaned:
    """Keypoints with all gaps filled, and which stretches of them to keep.

    Attributes:
        keypoints: (n, 17, 3) positions [m], none NaN.
        kept: Stretches of frames without a long gap.
        counts: Frames that were read, mended and kept, and those cut, by the name of the reason.
    """

    keypoints: np.ndarray
    kept: list[slice]
    counts: Counter[str]


def clean(keypoints: np.ndarray, rate: float) -> Cleaned:
    """Mend gaps of at most LONGEST_GAP, across which an arm can have moved; mark the others to be cut.

    Args:
        keypoints: (n, 17, 3) positions [m], pelvis frame, NaN where lost.
        rate: Frames a second.
    """
    reasons = _reasons(keypoints, rate)
    good = np.flatnonzero(reasons == 0)
    counts = Counter({"read": len(keypoints)})
    cut = np.zeros(len(keypoints), bool)
    for gap in _runs(reasons > 0):
        if _can_be_mended(keypoints, gap, rate):
            counts["mended"] += gap.stop - gap.start
        else:
            cut[gap] = True
            counts += Counter(REASONS[reason - 1] for reason in reasons[gap])
    counts["kept"] = int(np.sum(~cut))
    if len(good) < 2:
        return Cleaned(np.zeros_like(keypoints), [], counts)
    filled = PchipInterpolator(good, keypoints[good])(np.clip(np.arange(len(keypoints)), good[0], good[-1]))
    return Cleaned(filled, _runs(~cut), counts)


def _reasons(keypoints: np.ndarray, rate: float) -> np.ndarray:
    """What is wrong with each frame: 0 nothing, else the number of its reason in REASONS, from 1."""
    lost = ~np.isfinite(keypoints).all(axis=(1, 2))
    bones = arm_bones(keypoints)
    stretch = bones / np.nanmedian(bones[~lost], axis=0) if not lost.all() else bones
    broken = ((stretch < STRETCH[0]) | (stretch > STRETCH[1])).any(axis=(1, 2))
    moves = np.diff(keypoints[:, _ELBOWS_AND_WRISTS], axis=0)
    jumps = (np.linalg.norm(moves, axis=-1) * rate > FASTEST).any(axis=1)
    jumped = np.append(jumps, False) | np.append(False, jumps)
    bad = lost | broken | jumped
    jumped |= binary_closing(bad, np.ones(max(1, round(LONGEST_GAP * rate))))
    return np.select([lost, broken, jumped], [1, 2, 3])


def _can_be_mended(keypoints: np.ndarray, gap: slice, rate: float) -> bool:
    before, after = gap.start - 1, gap.stop
    if before < 0 or after == len(keypoints) or (gap.stop - gap.start) / rate > LONGEST_GAP:
        return False
    way = np.linalg.norm(keypoints[after] - keypoints[before], axis=-1)[_ELBOWS_AND_WRISTS]
    return bool((way * rate / (after - before) <= FASTEST).all())


def _runs(mask: np.ndarray) -> list[slice]:
    """The stretches of frames where a mask is true."""
    return [run[0] for run in find_objects(label(mask)[0])]
