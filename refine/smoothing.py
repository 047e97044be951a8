"""Streaming smoothing: windows joined without a jump, then the Gaussian that LSG21 puts on its output."""

import numpy as np
from scipy.ndimage import gaussian_filter1d

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.fading import faded
from gesture_bot.base.frames import KeypointClip
from gesture_bot.base.keypoints import IN_ARM, KEYPOINTS, bone_lengths, with_bone_lengths

SIGMA = 1.5
"""Standard deviation of the Gaussian over time [frames] (LSG21)."""

RADIUS = 4
"""The Gaussian is cut off this far from its middle [frames]: a frame is final once so many follow it."""

ARMS, TRUNK = 2.0, 6.0
"""Half-life of the offset of a keypoint at a seam [frames].

In arms, under 3% of it is left at the end of an 8-frame window. Trunk, head and shoulders stand otherwise in
every recording, and move so little within one that they must not follow each window.
"""


HISTORY = 60
"""Frames kept before the last clip; a new clip may cut the motion that far back."""


class WindowJoiner:
    """Joins windows into one motion without a jump, as they come.

    Where two windows meet, the new one does not start where the motion was heading. The difference, in
    position and velocity of each keypoint, is added to the new window and dies away like a critically
    damped spring: the inertialization of Bollo (GDC 2018), with the spring of Holden.

    Attributes:
        start: Frame of the first pose that is kept.
        motion: (n, 17, 3) what is kept: the last clip, and up to HISTORY frames before it [m].
        lengths: (n, 16) bone lengths of the clips, which joining changes in `motion` [m].
    """

    def __init__(self) -> None:
        self.start = 0
        self.motion = np.empty((0, len(KEYPOINTS), 3))
        self.lengths = np.empty((0, len(KEYPOINTS) - 1))

    def push(self, clip: KeypointClip) -> None:
        """Take the next clip; it replaces everything from its first frame on.

        A clip that starts inside the motion so far cuts it. The last pose is held over a gap between the
        motion and the clip. A clip from before all that is kept begins a new motion.

        Raises:
            InvalidValueError: Keypoints are not (n, 17, 3), n > 0, or not finite. The motion so far stands.
        """
        frames = np.asarray(clip.keypoints, np.float64)
        if frames.shape[1:] != (len(KEYPOINTS), 3) or not len(frames):
            raise InvalidValueError(
                "keypoints must be (n, 17, 3) with n > 0, but their shape is", frames.shape
            )
        if not np.isfinite(frames).all():
            frame, keypoint = np.argwhere(~np.isfinite(frames))[0, :2]
            raise InvalidValueError(
                f"frame {clip.start + frame} has a keypoint that is not finite", KEYPOINTS[keypoint]
            )
        motion, lengths = frames, bone_lengths(frames)
        if len(self.motion) and clip.start > self.start:
            before = self._frames_before(clip.start)
            joined = frames + _seam_offset(self.motion[before], frames)
            motion = np.concatenate([self.motion[before], joined])
            lengths = np.concatenate([self.lengths[before], lengths])
        self.motion, self.lengths, self.start = motion, lengths, clip.stop - len(motion)

    def _frames_before(self, frame: int) -> np.ndarray:
        """Indices of the last HISTORY frames before a frame; the motion's last one repeats over a gap."""
        frames = np.arange(max(self.start, frame - HISTORY), frame)
        return np.minimum(frames - self.start, len(self.motion) - 1)


class WindowSmoother:
    """Joins windows, smooths them by the Gaussian, and gives the bones the lengths that both have changed.

    Attributes:
        joiner: What joins them.
    """

    def __init__(self) -> None:
        self.joiner = WindowJoiner()

    def push(self, clip: KeypointClip) -> KeypointClip:
        """Take the next clip; see WindowJoiner.push.

        Returns:
            The smooth motion from 4 frames before the clip (where there are any: their future is known
            only now) to the clip's end. The last 4 frames are provisional, smoothed as if the last pose
            were held, and come again with the next clip.

        Raises:
            InvalidValueError: See WindowJoiner.push.
        """
        self.joiner.push(clip)
        motion, lengths = self.joiner.motion, self.joiner.lengths
        emitted = slice(-min(len(clip.keypoints) + RADIUS, len(motion)), None)
        keypoints = with_bone_lengths(gaussian(motion, SIGMA)[emitted], gaussian(lengths, SIGMA)[emitted])
        return KeypointClip(clip.stop - len(keypoints), keypoints)


def gaussian(values: np.ndarray, sigma: float) -> np.ndarray:
    """A Gaussian over frames (n, ...), of a standard deviation [frames], cut off at RADIUS."""
    return gaussian_filter1d(values, sigma, axis=0, mode="nearest", radius=RADIUS)


def _seam_offset(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """What to add to the frames after a seam so that they go on from those before it: (n, 17, 3) [m].

    Both sides are extended to the middle of the seam, half a frame from each, where they are compared.
    There the two extensions of one smooth motion agree, so that a window that goes on from the last stays
    as it is (position to second order, velocity to third).
    """
    position, velocity = _extended(before[::-1])
    after_position, after_velocity = _extended(after)
    offset = position - after_position
    # What moves slowly has no velocity that is worth to go on for so long.
    offset_velocity = np.where(IN_ARM[:, None], -velocity - after_velocity, 0)
    elapsed = (np.arange(len(after)) + 0.5)[:, None, None]
    return faded(offset, offset_velocity, elapsed, np.where(IN_ARM, ARMS, TRUNK)[:, None])[0]


def _extended(frames: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Position, and velocity a frame, half a frame before the first of `frames`."""
    first, second, third = frames[np.minimum([0, 1, 2], len(frames) - 1)]
    return first - (second - first) / 2, 2 * (second - first) - (third - second)
