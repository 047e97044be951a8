"""The gesture selector: from speech features, keywords and controls to windows of motion, ahead of time."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.frames import FRAME_RATE, WINDOW, first_frame_after, frame_time
from gesture_bot.corpus.database import Database
from gesture_bot.matching.banks import Gesture
from gesture_bot.matching.controls import Admission, Constraint, Controls
from gesture_bot.matching.emotions import Emotion, find_emotion
from gesture_bot.matching.features import AUDIO_OFFSETS
from gesture_bot.matching.keyframes import render
from gesture_bot.matching.plan import Plan, Window
from gesture_bot.matching.search import Preselection, Search, check_settings
from gesture_bot.matching.settling import Settling, rest_pose
from gesture_bot.speech.features import COEFFICIENTS, FEATURES, SILENCE_FEATURES

SPEECH_RANGE = 25.0
"""A frame is speech where its energy is less than this under the 75th percentile of the database [dB]."""

ONSET = 4
"""Frames before the first sound of speech at which motion begins: a gesture is prepared before its word."""

SHORTEST_PREPARATION = 0.3
"""A person needs at least so long to bring a hand up [s]."""

AHEAD = 0.8
"""Windows are planned so long before they are seen [s]: time for refinement, retargeting and the bus."""

STROKE_LEAD = 0.08
"""A stroke is planned to end so much before its word [s].

The smoothing and the servos round off its end, which the robot reaches about so much later; and people make
a stroke with its word or a little before.
"""

LATEST_STROKE = 0.7
"""A stroke that would come later than this after its word no longer belongs to it [s]."""


@dataclass(frozen=True)
class _Keyword:
    name: str
    stroke: float


@dataclass(frozen=True)
class _Timing:
    """First frame of a gesture, its preparation [s], and when its stroke is seen [s since the epoch]."""

    begin: int
    preparation: float
    stroke: float


class Selector:
    """Plans the motion of the upper body, window by window.

    Speech is matched in the database, silence is rest, and a keyword is a gesture of the banks. A gesture
    once begun is finished up to its last keyframe; speech that goes on, or the next gesture, cuts its
    retraction short. A keyword whose stroke would come more than LATEST_STROKE after its word, or within the
    cooldown of its gesture, is dropped.

    Args:
        database: Where windows of speech come from.
        gestures: Every gesture; see banks.load_banks.
        emotions: Every emotion; see emotions.load_emotions.
        k: Each window is one of the k best matches, drawn evenly; 1 always takes the best.
        preselection: See Search.find.
        seed: Of that draw.
        ahead: Windows are planned so long before they are seen [s].
        react: What is seen sooner than this from now is not changed any more [s].
    """

    def __init__(
        self,
        database: Database,
        gestures: Mapping[str, Gesture],
        emotions: Mapping[str, Emotion],
        k: int = 1,
        preselection: Preselection = "pose",
        seed: int = 0,
        ahead: float = AHEAD,
        react: float = 0.4,
    ) -> None:
        self._database, self._emotions, self._gestures = database, emotions, gestures
        check_settings(k, preselection)
        self._search, self._controls = Search(database), Controls(database)
        self._k, self._preselection, self._generator = k, preselection, np.random.default_rng(seed)
        self._ahead, self._react = ahead, react
        self._rest = rest_pose(database)
        self._threshold = float(np.percentile(database.features[:, COEFFICIENTS], 75)) - SPEECH_RANGE

        self._plan: Plan | None = None
        self._settling: Settling | None = None
        self._features: dict[int, np.ndarray] = {}
        self._last_heard = -WINDOW
        self._keywords: list[_Keyword] = []
        self._strokes: dict[str, float] = {}
        self._free_from = 0
        self._late = 0
        self._emotion = find_emotion(emotions, "neutral", 0.0, 0.0)
        self._constraints: tuple[Constraint, ...] = ()
        self._admission = self._admit()

    @property
    def emotion(self) -> str:
        """Label of the emotion."""
        return self._emotion.name

    @property
    def eligible(self) -> float:
        """Share of the database's windows that emotion and controls leave."""
        return self._admission.share

    @property
    def relaxed(self) -> tuple[str, ...]:
        """What had to give way for that, in words; see Controls.admit."""
        return self._admission.relaxed

    @property
    def late(self) -> int:
        """How often a plan was asked for after the last one had run out."""
        return self._late

    def set_emotion(self, label: str, valence: float = 0.0, arousal: float = 0.0) -> None:
        """Move with an emotion from the next window on.

        Raises:
            InvalidValueError: See emotions.find_emotion; the emotion stays as it was.
        """
        self._emotion = find_emotion(self._emotions, label, valence, arousal)
        self._admission = self._admit()

    def set_controls(self, constraints: Sequence[Constraint]) -> None:
        """Keep these constraints, the first one the strongest, and no others, from the next window on."""
        self._constraints = tuple(constraints)
        self._admission = self._admit()

    def add_features(self, frame: int, features: np.ndarray) -> None:
        """Take in the sound of a frame, usually before it is heard.

        Args:
            frame: Index on the grid.
            features: (28,) speech features; see speech.features.

        Raises:
            InvalidValueError: They are not 28 finite numbers.
        """
        if np.shape(features) != (FEATURES,) or not np.isfinite(features).all():
            raise InvalidValueError(
                f"speech features of frame {frame}", features, [f"{FEATURES} finite numbers"]
            )
        self._features[frame] = np.asarray(features, np.float32)
        self._last_heard = frame

    def add_keyword(self, gesture: str, stroke: float) -> None:
        """Make a gesture with its stroke at a moment [s since the epoch], or as soon after as a person could.

        Raises:
            InvalidValueError: The gesture is in no bank, or the moment is not finite.
        """
        if gesture not in self._gestures:
            raise InvalidValueError("unknown gesture", gesture, self._gestures)
        if not math.isfinite(stroke):
            raise InvalidValueError(f"moment of the gesture {gesture}", stroke, ["seconds since the epoch"])
        self._keywords.append(_Keyword(gesture, stroke))
        self._keywords.sort(key=lambda keyword: keyword.stroke)

    def plan(self, now: float) -> list[Window]:
        """Windows that are new since the last call, so that everything up to `ahead` from now is planned.

        Call it often, at least every 0.2 s. A window replaces all that was planned from its first frame on.

        Args:
            now: The present [s since the epoch].

        Returns:
            Windows in the order of time, without a gap between them; none while enough is planned.
        """
        soonest = first_frame_after(now + self._react)
        if self._plan is None:
            self._plan = Plan(soonest, self._rest)
        plan = self._plan
        if plan.end < first_frame_after(now):
            self._late += 1
            plan.hold(soonest)
            self._settling = None
        plan.forget(first_frame_after(now) - WINDOW)
        oldest = soonest - 2 * WINDOW
        self._features = {frame: features for frame, features in self._features.items() if frame > oldest}
        self._interrupt_rest(plan, soonest)

        windows: list[Window] = []
        horizon = first_frame_after(now + self._ahead)
        while True:
            timing = self._next_gesture(soonest)
            if timing and timing.begin <= plan.end:
                window = self._gesture(plan, timing)
            elif plan.end > horizon:
                return windows
            else:
                frames = min(WINDOW, timing.begin - plan.end) if timing else WINDOW
                found = self._speech(plan, frames) if self._is_spoken(plan.end) else None
                window = found or self._silence(plan, frames)
            if window.source != "rest":
                self._settling = None
            plan.add(window)
            windows.append(window)

    def _admit(self) -> Admission:
        return self._controls.admit(self._constraints, self._emotion.labels, self._emotion.constraints)

    def _speaks(self, frame: int) -> bool:
        """Whether a frame is speech; up to a window after the last one known, it is taken to be like that."""
        if frame not in self._features and self._last_heard < frame <= self._last_heard + WINDOW:
            frame = self._last_heard
        return frame in self._features and bool(self._features[frame][COEFFICIENTS] > self._threshold)

    def _is_spoken(self, start: int) -> bool:
        """Whether there is speech in a window that begins here, or so soon after that it prepares for it."""
        return any(self._speaks(frame) for frame in range(start, start + WINDOW + ONSET))

    def _interrupt_rest(self, plan: Plan, soonest: int) -> None:
        """Cut the plan where it rests, or hands retract, although somebody speaks."""
        for window in plan.windows:
            if window.source != "speech":
                first = max(window.start, soonest, self._free_from)
                for frame in range(first, window.stop):
                    if self._speaks(frame):
                        plan.cut(max(frame - ONSET, first))
                        return

    def _speech(self, plan: Plan, frames: int) -> Window | None:
        """The window that goes on best from the last pose with the sound; None where none is eligible."""
        start, last = plan.end, plan.last
        if last.source == "speech":
            row = self._search.row(last.sequence, last.frame + len(last.keypoints) - 1)
            pose = self._search.pose_at(row)
        else:
            pose = self._search.pose_of(last.keypoints[-1])
        heard = range(start, start + AUDIO_OFFSETS[-1] + 1)
        sound = self._search.audio_of(
            np.array([self._features.get(frame, SILENCE_FEATURES) for frame in heard])
        )
        k = int(self._generator.integers(1, self._k + 1))
        match = self._search.find(pose, sound, self._admission.mask, k, self._preselection)
        if match is None:
            return None
        row = self._search.row(match.sequence, match.frame)
        return Window(
            start,
            self._database.keypoints[row : row + frames].astype(np.float64),
            "speech",
            sequence=match.sequence,
            frame=match.frame,
            pose_distance=match.pose_distance,
            audio_distance=match.audio_distance,
            candidates=match.candidates,
        )

    def _silence(self, plan: Plan, frames: int) -> Window:
        """A window of rest that goes on from the last pose and velocity."""
        if self._settling is None:
            self._settling = self._settle(plan)
        return Window(plan.end, self._settling.at(np.arange(plan.end, plan.end + frames)), "rest")

    def _settle(self, plan: Plan) -> Settling:
        return Settling(plan.end - 1, *plan.pose_and_velocity(), self._rest)

    def _next_gesture(self, soonest: int) -> _Timing | None:
        """When the next keyword's gesture begins; keywords that come too late or too soon are dropped."""
        while self._keywords:
            keyword = self._keywords[0]
            gesture = self._gestures[keyword.name]
            free = max(soonest, self._free_from)
            onset = gesture.keyframes[0].time - STROKE_LEAD
            # A gesture that begins with a frame leaves the pose of the frame before.
            stroke = max(keyword.stroke, frame_time(free - 1) + SHORTEST_PREPARATION - onset)
            since_last = stroke - self._strokes.get(keyword.name, -math.inf)
            if stroke - keyword.stroke <= LATEST_STROKE and since_last > gesture.cooldown:
                preparation = min(gesture.preparation, stroke + onset - frame_time(free - 1))
                begin = first_frame_after(stroke + onset - preparation)
                return _Timing(max(begin, free), preparation, stroke)
            self._keywords.pop(0)
        return None

    def _gesture(self, plan: Plan, timing: _Timing) -> Window:
        """The next keyword's gesture, laid over a body that settles."""
        keyword = self._keywords.pop(0)
        gesture = self._gestures[keyword.name]
        plan.cut(timing.begin)
        self._strokes[keyword.name] = timing.stroke
        planned = timing.stroke - STROKE_LEAD
        over = planned + gesture.keyframes[-1].time
        self._free_from = first_frame_after(over)
        frames = np.arange(timing.begin, first_frame_after(over + gesture.retraction) + 1)
        underlying = self._settle(plan).at(frames)
        keypoints = render(gesture, frames / FRAME_RATE - planned, timing.preparation, underlying)
        return Window(timing.begin, keypoints, "bank", keyword.name, stroke=timing.stroke)
