"""Keywords in time: which gesture is made, by which hand, and when, so that its stroke is on its word."""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.frames import FRAME_RATE, first_frame_after, frame_time
from gesture_bot.base.keypoints import mirror
from gesture_bot.matching.arms import SIDES, Arm
from gesture_bot.matching.banks import Gesture, Motion
from gesture_bot.matching.emotions import Emotion
from gesture_bot.matching.plan import Window
from gesture_bot.matching.rendering import render
from gesture_bot.matching.settling import Settling

HASTE = 0.7
"""Share of a gesture's preparation that somebody in a hurry needs at least."""

SLOW = 0.2
"""Share of the way's time at its end in which it is slow: a stroke is seen to end where that begins.

By minimum jerk (Flash and Hogan 1985), the speed is below a tenth of its peak for the last fifth of the time.
"""

ROUNDED = 0.155
"""How much later that is seen on the robot than it is planned [s]: the smoothing rounds off the end."""

LONGEST_WAIT = 0.7
"""A keyword does not wait longer than this for another gesture to be finished [s]."""

LATEST_STROKE = 1.5
"""A stroke that would come later than this after its word no longer belongs to it [s]."""

PREFERENCE = 0.1
"""The hand that the bank names makes the gesture unless the other one is so much nearer [m]."""


@dataclass(frozen=True)
class _Keyword:
    name: str
    gesture: Gesture
    weight: float
    stroke: float


@dataclass(frozen=True)
class Timing:
    """When and how the gesture of a keyword is made.

    Attributes:
        keyword: The keyword.
        motion: Its gesture, or the emotion's variant of it.
        tempo, amplitude: Of the emotion; 1 for its own variant.
        free: First frame that the gesture before it leaves to this one.
        begin: First frame of the preparation.
        preparation: Its length [s].
        stroke: When the stroke is seen [s since the epoch].
    """

    keyword: _Keyword
    motion: Motion
    tempo: float
    amplitude: float
    free: int
    begin: int
    preparation: float
    stroke: float

    @property
    def planned(self) -> float:
        """The moment of the stroke on the frame grid [s since the epoch]."""
        return self.stroke - lead(self.motion)

    @property
    def committed(self) -> int:
        """The frame from which on the gesture is finished, whatever comes."""
        onset = min(self.motion.movement.first, -_shortest(self.motion))
        return first_frame_after(self.planned + onset)

    @property
    def over(self) -> int:
        """The frame at which all but the retraction is done."""
        return first_frame_after(self.planned + self.motion.movement.last / self.tempo)

    @property
    def stop(self) -> int:
        """The frame after the retraction."""
        last = self.motion.movement.last + self.motion.retraction
        return first_frame_after(self.planned + last / self.tempo) + 1


class Strokes:
    """Keywords that wait for their gestures, and the gesture that was made last.

    A gesture is finished up to its retraction once its stroke has begun. Before that, a heavier keyword takes
    its place if it would be late otherwise, and is prepared at once, so that no half stroke is seen. Of
    keywords that wait, one gives way to a heavier one that it would delay; any other waits up to LONGEST_WAIT
    for the gesture before it, and is dropped then. It is dropped, too, within the cooldown of its gesture,
    and where the stroke would come more than LATEST_STROKE after its word.

    An emotion changes the gestures that are planned after it: by its variant of the gesture, or else by its
    amplitude and its tempo, which changes all times but the stroke's.

    Where a gesture may be mirrored, the nearer hand makes it, unless that one is to stay low.

    Args:
        gestures: Every gesture; see banks.load_banks.
    """

    def __init__(self, gestures: Mapping[str, Gesture]) -> None:
        self._gestures = gestures
        self._keywords: list[_Keyword] = []
        self._last: Timing | None = None
        self._over = 0
        self._made: dict[str, float] = {}

    def set_gestures(self, gestures: Mapping[str, Gesture]) -> None:
        """Make other gestures for the keywords to come; those that were added are made as they were."""
        self._gestures = gestures

    @property
    def free_from(self) -> int:
        """The frame at which the last gesture is finished but for its retraction."""
        return self._over

    def add(self, gesture: str, stroke: float, phrase: str = "") -> None:
        """Make a gesture with its stroke at a moment, or as soon after as a person could.

        Args:
            gesture: Its name.
            stroke: The moment [s since the epoch].
            phrase: The trigger that calls it, for its weight.

        Raises:
            InvalidValueError: The gesture is in no bank, or the moment is not finite.
        """
        if gesture not in self._gestures:
            raise InvalidValueError("unknown gesture", gesture, self._gestures)
        if not math.isfinite(stroke):
            raise InvalidValueError(f"moment of the gesture {gesture}", stroke, ["seconds since the epoch"])
        called = self._gestures[gesture]
        self._keywords.append(_Keyword(gesture, called, called.weight(phrase), stroke))
        self._keywords.sort(key=lambda keyword: keyword.stroke)

    def cut(self, moment: float) -> None:
        """Drop what has its stroke from a moment on; a gesture that is under way ends there, too."""
        self._keywords = [keyword for keyword in self._keywords if keyword.stroke < moment]
        if self._last and self._last.stroke >= moment:
            self._made.pop(self._last.keyword.name, None)
            self._last = None
        self._over = min(self._over, first_frame_after(moment))

    def next(self, soonest: int, emotion: Emotion) -> Timing | None:
        """The next keyword's gesture; keywords that cannot be made are dropped.

        Args:
            soonest: The first frame that may still be changed.
            emotion: The emotion in force.
        """
        while self._keywords:
            keyword, *others = self._keywords
            timing = self._timing(keyword, soonest, emotion)
            if timing and not any(
                other.weight > keyword.weight and self._delays(timing, other, soonest, emotion)
                for other in others
            ):
                return timing
            self._keywords.pop(0)
        return None

    def window(self, timing: Timing, settling: Settling, low: Collection[str] = ()) -> Window:
        """The next keyword's gesture, which is made now.

        Args:
            timing: What `next` has said.
            settling: The body from the frame before on, without the gesture.
            low: Hands that are to stay low.
        """
        self._keywords.remove(timing.keyword)
        if self._last and timing.begin < self._over:
            self._made.pop(self._last.keyword.name, None)
        self._last, self._over = timing, timing.over
        self._made[timing.keyword.name] = timing.stroke

        frames = np.arange(timing.begin, timing.stop)
        times = frames / FRAME_RATE - timing.planned
        times[times > 0] *= timing.tempo
        underlying = settling.at(frames)
        if timing.keyword.gesture.mirrored and _other_hand(timing.motion, settling.pose, low):
            turned = render(timing.motion, times, timing.preparation, mirror(underlying), timing.amplitude)
            keypoints = mirror(turned)
        else:
            keypoints = render(timing.motion, times, timing.preparation, underlying, timing.amplitude)
        return Window(timing.begin, keypoints, "bank", timing.keyword.name, stroke=timing.stroke)

    def _timing(self, keyword: _Keyword, soonest: int, emotion: Emotion) -> Timing | None:
        """When a keyword's gesture can be made after or instead of the last one; None where it cannot."""
        last = self._last
        alone = _fitted(keyword, soonest, emotion)
        timing = _fitted(keyword, max(soonest, self.free_from), emotion)
        if last and keyword.weight > last.keyword.weight and soonest < last.committed:
            instead = _fitted(keyword, max(soonest, last.free), emotion, last.committed)
            timing = min(timing, instead, key=lambda fitted: fitted.stroke)
        since_last = timing.stroke - self._made.get(keyword.name, -math.inf)
        late = timing.stroke - keyword.stroke > LATEST_STROKE
        waits = timing.stroke - alone.stroke > LONGEST_WAIT
        return None if late or waits or since_last <= keyword.gesture.cooldown else timing

    def _delays(self, timing: Timing, other: _Keyword, soonest: int, emotion: Emotion) -> bool:
        """Whether another keyword that could be made would be late because of a gesture."""
        alone = self._timing(other, soonest, emotion)
        return alone is not None and _fitted(other, timing.over, emotion).stroke > alone.stroke


def _fitted(keyword: _Keyword, free: int, emotion: Emotion, latest: float = math.inf) -> Timing:
    """When a keyword's gesture is made if it may begin at frame `free`, and must not after `latest`."""
    variant = keyword.gesture.variant(emotion.name)
    motion: Motion = variant or keyword.gesture
    tempo, amplitude = (1.0, 1.0) if variant else (emotion.tempo, emotion.amplitude)
    onset = motion.movement.first - lead(motion)
    # A gesture that begins with a frame leaves the pose of the frame before.
    stroke = max(keyword.stroke, frame_time(free - 1) + _shortest(motion) - onset)
    # Where the first keyframe is the stroke's, so is the way to it.
    preparation = motion.preparation / (tempo if motion.movement.first < 0 else 1)
    leave = min(stroke + onset - preparation, (latest - 1) / FRAME_RATE)
    leave = max(leave, frame_time(free - 1))
    begin = max(first_frame_after(leave), free)
    preparation = stroke + onset - leave
    return Timing(keyword, motion, tempo, amplitude, free, begin, preparation, stroke)


def lead(motion: Motion) -> float:
    """How long before its word a stroke's keyframe is planned [s], so that it is seen to end on the word."""
    before = motion.movement.moments[motion.movement.moments < 0]
    way = -before.max() if len(before) else motion.preparation
    return max(0.0, ROUNDED - SLOW * way)


def _shortest(motion: Motion) -> float:
    """The least time for a motion's preparation [s]."""
    return HASTE * motion.preparation


def _other_hand(motion: Motion, pose: np.ndarray, low: Collection[str]) -> bool:
    """Whether the mirrored gesture suits a pose (17, 3) better, with hands that are to stay low."""
    swapped = [side for side, other in zip(SIDES, SIDES[::-1], strict=True) if other in low]
    as_written, mirrored = _effort(motion, pose, low), _effort(motion, mirror(pose), swapped)
    return mirrored[0] < as_written[0] or (
        mirrored[0] == as_written[0] and mirrored[1] < as_written[1] - PREFERENCE
    )


def _effort(motion: Motion, pose: np.ndarray, low: Collection[str]) -> tuple[int, float]:
    """How many low hands a gesture raises from a pose (17, 3), and how far it is to its beginning [m]."""
    raised, far = 0, 0.0
    for side in SIDES:
        arm = motion.movement.arm(side, np.array([motion.movement.first]), pose)
        if arm is not None:
            raised += side in low
            far += float(np.linalg.norm(arm.wrist - Arm.of(pose[None], side).wrist))
    return raised, far
