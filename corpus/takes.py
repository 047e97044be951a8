"""From a take to recordings: the whole way through map, one body, cleaning and resampling."""

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from gesture_bot.base.errors import FileFormatError
from gesture_bot.base.frames import FRAME_RATE
from gesture_bot.base.keypoints import with_bone_lengths
from gesture_bot.corpus.cleaning import REASONS, clean
from gesture_bot.corpus.database import LOOKAHEAD, SEQUENCE
from gesture_bot.corpus.one_body import (
    STANDARD_LENGTHS,
    arm_bones,
    in_pelvis_frame,
    in_standard_size,
    is_upright,
)
from gesture_bot.corpus.recordings import Recording
from gesture_bot.corpus.resampling import frames_until, to_frame_rate
from gesture_bot.corpus.skeletons import SkeletonMap
from gesture_bot.corpus.sources import Take

CUT = (*REASONS, "soundless", "short", "unusable")
"""Why frames are cut: the reasons of cleaning.py, no sound any more, a stretch shorter than a sequence, or a
take that cannot be used at all, of several in a file."""


@dataclass(frozen=True)
class Motion:
    """The motion of a take, on the standard body.

    Attributes:
        keypoints: (m, 17, 3) positions [m], pelvis frame, at 15 frames a second, the first as in the take;
            what fills long gaps is made up. Without any stretch to keep, m is 0.
        rate: The take's frames a second.
        kept: The stretches of the take's frames without a long gap.
        counts: Of the take's frames; see cleaning.Cleaned.
    """

    keypoints: np.ndarray
    rate: float
    kept: list[slice]
    counts: Counter[str]


def motion_of(take: Take, skeleton: SkeletonMap) -> Motion:
    """The whole way from a take's joints to keypoints.

    Raises:
        FileFormatError: The take lacks joints of the map, a frame rate, or arms, or its axes are others.
    """
    rate = take.rate or skeleton.rate
    if rate is None:
        raise FileFormatError(f"neither the file nor the skeleton map {skeleton.name} says the frame rate")
    keypoints = skeleton.keypoints(take)
    if not np.isfinite(arm_bones(keypoints)).all(axis=(1, 2)).any():
        raise FileFormatError("no frame shows both arms")
    if not is_upright(keypoints):
        raise FileFormatError(
            f"the speaker is not upright: other axes than the skeleton map {skeleton.name}'s?"
        )
    cleaned = clean(in_pelvis_frame(in_standard_size(keypoints)), rate)
    moving = np.empty((0, *keypoints.shape[1:]))
    if cleaned.kept:
        moving = with_bone_lengths(to_frame_rate(cleaned.keypoints, rate), STANDARD_LENGTHS)
    return Motion(moving, rate, cleaned.kept, cleaned.counts)


def recordings_of(
    take: Take, skeleton: SkeletonMap, features: np.ndarray, labels: Mapping[str, str]
) -> tuple[list[Recording], Counter[str]]:
    """The stretches of a take that can be used, one recording each.

    A stretch that is shorter than a sequence is left out, unless it is the whole take.

    Args:
        take: As read.
        skeleton: The map of its joints and axes.
        features: (m, 28) speech features of the whole take; see speech/features.py.
        labels: Of all the recordings, by kind.

    Returns:
        The recordings, and counts of the source's frames: `read`, `mended`, `kept`, and those of CUT.

    Raises:
        FileFormatError: As motion_of, or the features hold numbers that are not finite.
    """
    if not np.isfinite(features).all():
        raise FileFormatError("its speech features are not all finite")
    motion = motion_of(take, skeleton)
    rate, counts = motion.rate, motion.counts
    recordings = []
    for kept in motion.kept:
        heard = min(kept.stop, math.ceil(len(features) / FRAME_RATE * rate))
        counts["soundless"] += kept.stop - max(heard, kept.start)
        first = math.ceil(kept.start / rate * FRAME_RATE - 1e-6)
        stop = min(frames_until(kept.stop - 1, rate), len(features))
        whole = kept == slice(0, len(take.positions), None)
        if stop - first < (1 if whole else SEQUENCE):
            counts["short"] += max(heard - kept.start, 0)
            continue
        recordings.append(
            Recording(
                f"{take.name} {first / FRAME_RATE:.1f} s",
                motion.keypoints[first:stop].astype(np.float32),
                features[first : stop + LOOKAHEAD].astype(np.float32),
                dict(labels),
            )
        )
    counts["kept"] -= counts["short"] + counts["soundless"]
    return recordings, counts
