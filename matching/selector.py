"""The gesture selector: from speech features, keywords and controls to windows of motion, ahead of time."""

from collections.abc import Mapping, Sequence

import numpy as np

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.frames import FRAME_RATE, WINDOW, first_frame_after
from gesture_bot.corpus.database import Database
from gesture_bot.matching.banks import Gesture
from gesture_bot.matching.controls import Admission, Constraint, Controls, Demand, LabelConstraint
from gesture_bot.matching.emotions import Emotion, find_emotion
from gesture_bot.matching.features import AUDIO_OFFSETS
from gesture_bot.matching.plan import Plan, Window
from gesture_bot.matching.search import Preselection, Search, check_settings
from gesture_bot.matching.settling import Settling, rest_pose
from gesture_bot.matching.shaping import enlarged, played
from gesture_bot.matching.strokes import Strokes
from gesture_bot.speech.features import COEFFICIENTS, FEATURES, SILENCE_FEATURES
from gesture_bot.speech.loudness import SPEECH_LEVEL

LEAST_SPEECH = SPEECH_LEVEL - 25.0
"""A frame is speech where its energy is over this [dB]: features are those of normalised sound."""

ONSET = 4
"""Frames before the first sound of speech at which motion begins: a gesture is prepared before its word."""

AHEAD = 0.8
"""Windows are planned so long before they are seen [s]: time for refinement, retargeting and the bus."""

CUT_REACT = 0.1
"""What is seen sooner than this is not changed by a cut any more [s]: time for the bus alone."""

LATELY = 25 * FRAME_RATE
"""A window of speech does not come again within so many frames, where there are others."""


class Selector:
    """Plans the motion of the upper body, window by window.

    Speech is matched in the database, silence is rest, and a keyword is a gesture of the banks. A gesture
    once begun is finished up to its last keyframe; speech that goes on, or the next gesture, cuts its
    retraction short. A keyword whose stroke would come more than LATEST_STROKE after its word, or within the
    cooldown of its gesture, is dropped; see strokes.Strokes.

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
        self._database, self._emotions = database, emotions
        check_settings(k, preselection)
        self._search, self._controls = Search(database), Controls(database)
        self._k, self._preselection, self._generator = k, preselection, np.random.default_rng(seed)
        self._ahead, self._react = ahead, react
        self._rest = rest_pose(database)

        self._plan: Plan | None = None
        self._settling: Settling | None = None
        self._features: dict[int, np.ndarray] = {}
        self._last_heard = -WINDOW
        self._strokes = Strokes(gestures)
        self._cut: int | None = None
        self._late = 0
        self._emotion = find_emotion(emotions, "neutral", 0.0, 0.0)
        self._constraints: tuple[Demand, ...] = ()
        self._since = 0.0
        self._asked: tuple[Sequence[Demand], ...] = ()
        self._admission: Admission
        self._admit()

    @property
    def emotion(self) -> str:
        """Label of the emotion."""
        return self._emotion.name

    @property
    def constraints(self) -> tuple[Demand, ...]:
        """The constraints that were asked for, and have not ended."""
        return self._constraints

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
        self._admit()

    def set_controls(self, constraints: Sequence[Demand], since: float = 0.0) -> None:
        """Keep these constraints and no others, from the next window on.

        Args:
            constraints: Any number; see controls.py.
            since: When they were asked for, from which their durations count [s since the epoch].

        Raises:
            InvalidValueError: The database lacks a label; the constraints stay as they were.
        """
        self._controls.check(constraints)
        self._constraints, self._since = tuple(constraints), since
        self._admit()

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

    def set_gestures(self, gestures: Mapping[str, Gesture]) -> None:
        """Take other banks for the keywords to come; see Strokes.set_gestures."""
        self._strokes.set_gestures(gestures)

    def add_keyword(self, gesture: str, stroke: float, phrase: str = "") -> None:
        """Make a gesture of the banks with its stroke at a moment; see Strokes.add."""
        self._strokes.add(gesture, stroke, phrase)

    def cut(self, moment: float) -> None:
        """Nothing of what was announced is heard from a moment on.

        Its gestures give way to rest then or, where it is too late for that, CUT_REACT and up to a frame
        after the next call of `plan`.

        Args:
            moment: On the clock of the plan [s since the epoch].
        """
        frame = first_frame_after(moment)
        self._features = {heard: features for heard, features in self._features.items() if heard < frame}
        self.add_features(frame, SILENCE_FEATURES)
        self._strokes.cut(moment)
        self._cut = frame if self._cut is None else min(frame, self._cut)

    def plan(self, now: float) -> list[Window]:
        """Windows that are new since the last call, so that everything up to `ahead` from now is planned.

        Call it often, at least every 0.2 s. A window replaces all that was planned from its first frame on.

        Args:
            now: The present [s since the epoch].

        Returns:
            Windows in the order of time, without a gap between them; none while enough is planned.
        """
        self._end_controls(now)
        soonest = first_frame_after(now + self._react)
        if self._plan is None:
            self._plan = Plan(soonest, self._rest)
        plan = self._plan
        if plan.end < first_frame_after(now):
            self._late += 1
            plan.hold(soonest)
            self._settling = None
        plan.forget(first_frame_after(now) - LATELY)
        oldest = soonest - 2 * WINDOW
        self._features = {frame: features for frame, features in self._features.items() if frame > oldest}
        if self._cut is not None:
            plan.cut(max(self._cut, first_frame_after(now + CUT_REACT)))
            self._settling, self._cut = None, None
        self._interrupt_rest(plan, soonest)

        windows: list[Window] = []
        horizon = first_frame_after(now + self._ahead)
        while True:
            timing = self._strokes.next(soonest, self._emotion)
            if timing and timing.begin <= min(plan.end, horizon):
                plan.cut(timing.begin)
                # Of the controls, a gesture heeds one alone: which hand is to stay low.
                low = [c.hand for c in self._bounds if (c.quantity, c.bound) == ("wrist_height", "at_most")]
                window = self._strokes.window(timing, self._settle(plan), low)
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

    @property
    def _bounds(self) -> list[Constraint]:
        return [constraint for constraint in self._constraints if isinstance(constraint, Constraint)]

    def _end_controls(self, now: float) -> None:
        """Drop the constraints whose time is over."""
        left = tuple(constraint for constraint in self._constraints if constraint.holds(self._since, now))
        if left != self._constraints:
            self._constraints = left
            self._admit()

    def _admit(self) -> None:
        known = self._database.names["emotion"]
        labels = tuple(label for label in self._emotion.labels if label in known)
        emotion: list[Demand] = [*self._emotion.constraints]
        if labels:
            # Recordings of an emotion show it better than bounds on others do.
            emotion.append(LabelConstraint("emotion", labels, priority=1))
        asked = self._constraints, tuple(emotion)
        # A state is often told again; in a large database it takes a while to apply.
        if asked != self._asked:
            self._asked, self._admission = asked, self._controls.admit(*asked)

    def _speaks(self, frame: int) -> bool:
        """Whether a frame is speech; up to a window after the last one known, it is taken to be like that."""
        if frame not in self._features and self._last_heard < frame <= self._last_heard + WINDOW:
            frame = self._last_heard
        return frame in self._features and bool(self._features[frame][COEFFICIENTS] > LEAST_SPEECH)

    def _is_spoken(self, start: int) -> bool:
        """Whether there is speech in a window that begins here, or so soon after that it prepares for it."""
        return any(self._speaks(frame) for frame in range(start, start + WINDOW + ONSET))

    def _interrupt_rest(self, plan: Plan, soonest: int) -> None:
        """Cut the plan where it rests, or hands retract, although somebody speaks."""
        for window in plan.windows:
            if window.source != "speech":
                first = max(window.start, soonest, self._strokes.free_from)
                for frame in range(first, window.stop):
                    if self._speaks(frame):
                        plan.cut(max(frame - ONSET, first))
                        return

    def _speech(self, plan: Plan, frames: int) -> Window | None:
        """The window that goes on best from the last pose with the sound; None where nothing ever moves."""
        start, last = plan.end, plan.last
        if last.source == "speech":
            shown = round(last.tempo * (len(last.keypoints) - 1))
            pose = self._search.pose_at(self._search.row(last.sequence, last.frame + shown))
        else:
            pose = self._search.pose_of(last.keypoints[-1])
        heard = range(start, start + AUDIO_OFFSETS[-1] + 1)
        sound = self._search.audio_of(
            np.array([self._features.get(frame, SILENCE_FEATURES) for frame in heard])
        )
        lately = [(seen.sequence, seen.frame) for seen in plan.windows[::-1] if seen.source == "speech"]
        mask, k = self._admission.without(lately), int(self._generator.integers(1, self._k + 1))
        match = self._search.find(pose, sound, mask, k, self._preselection)
        if match is None:
            # All that the controls leave is the very frame that is shown.
            match = self._search.find(pose, sound, np.ones_like(mask), k, self._preselection)
        if match is None:
            return None
        tempo, amplitude = self._shape(match.sequence)
        row = self._search.row(match.sequence, match.frame)
        recorded = played(self._database.keypoints, row, frames, tempo)
        # Another amplitude than that of the window before is reached within this one.
        amplitudes = np.linspace(last.amplitude, amplitude, frames + 1)[1:]
        return Window(
            start,
            enlarged(recorded, amplitudes, self._rest),
            "speech",
            sequence=match.sequence,
            frame=match.frame,
            pose_distance=match.pose_distance,
            audio_distance=match.audio_distance,
            candidates=match.candidates,
            tempo=tempo,
            amplitude=amplitude,
        )

    def _shape(self, sequence: int) -> tuple[float, float]:
        """Tempo and amplitude at which a sequence is shown.

        As recorded where the recording has the emotion, and where they would take a quantity over the bound
        that a control sets.
        """
        if self._database.label(sequence, "emotion") in self._emotion.labels:
            return 1.0, 1.0
        bounded = {constraint.quantity for constraint in self._bounds}
        tempo = 1.0 if "wrist_speed" in bounded else self._emotion.tempo
        return tempo, 1.0 if bounded else self._emotion.amplitude

    def _silence(self, plan: Plan, frames: int) -> Window:
        """A window of rest that goes on from the last pose and velocity."""
        if self._settling is None:
            self._settling = self._settle(plan)
        return Window(plan.end, self._settling.at(np.arange(plan.end, plan.end + frames)), "rest")

    def _settle(self, plan: Plan) -> Settling:
        return Settling(plan.end - 1, *plan.pose_and_velocity(), self._rest)
