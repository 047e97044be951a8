"""The gesture selector: from speech features, keywords and controls to windows of motion, ahead of time."""

import copy
import math
from collections.abc import Mapping, Sequence
from typing import Self

import numpy as np

from gesture_bot.base.frames import FRAME_RATE, WINDOW, first_frame_after
from gesture_bot.corpus.database import LOOKAHEAD, SEQUENCE, Database
from gesture_bot.matching.banks import Gesture
from gesture_bot.matching.controls import Admission, Constraint, Controls, Demand, LabelConstraint
from gesture_bot.matching.emotions import Emotion, find_emotion
from gesture_bot.matching.hearing import ONSET, Hearing
from gesture_bot.matching.plan import Plan, Window
from gesture_bot.matching.rhythm import AFTER, BEFORE, STRETCH, aligned, motion_beats
from gesture_bot.matching.search import Match, Preselection, Search, check_settings
from gesture_bot.matching.settling import Settling, nearest, rest_pose, rest_poses
from gesture_bot.matching.shaping import enlarged, played
from gesture_bot.matching.strokes import Strokes

AHEAD = 0.8
"""Where speech is announced, windows are planned so long before they are seen [s]."""

SOON = 0.3
"""Other windows are planned so long before they are seen [s]: time for all that comes after the search."""

REACT = 0.2
"""What is seen sooner than this is not changed any more [s]: time for what comes after, and to spare."""

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
        align_beats: Windows of speech are played so that the hands' beats fall on those of the speech, unless
            a control bounds the speed of the wrists; see rhythm.py.

    Attributes:
        hearing: Takes in the speech.
    """

    def __init__(
        self,
        database: Database,
        gestures: Mapping[str, Gesture],
        emotions: Mapping[str, Emotion],
        k: int = 1,
        preselection: Preselection = "pose",
        seed: int = 0,
        align_beats: bool = False,
    ) -> None:
        self._database, self._emotions, self._gestures = database, emotions, gestures
        check_settings(k, preselection)
        self._search, self._controls = Search(database), Controls(database)
        self._preselection, self._align_beats = preselection, align_beats
        self._rest, self._rest_poses = rest_pose(database), rest_poses(database)
        self._begin(k, seed, None)

    def fresh(self, k: int, seed: int, among: np.ndarray | None = None) -> Self:
        """Another one for the same database, which has heard and planned nothing.

        Args:
            k: See Selector.
            seed: Likewise.
            among: (S,) bool: the sequences that may be chosen; None: all.
        """
        check_settings(k, self._preselection)
        other = copy.copy(self)
        other._begin(k, seed, among)
        return other

    def _begin(self, k: int, seed: int, among: np.ndarray | None) -> None:
        self.hearing = Hearing(self._database)
        self._k, self._generator, self._among = k, np.random.default_rng(seed), among
        self._plan: Plan | None = None
        self._settling: Settling | None = None
        self._strokes = Strokes(self._gestures)
        self._cut: int | None = None
        self._late = 0
        self._emotion = find_emotion(self._emotions, "neutral", 0.0, 0.0)
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
        self.hearing.cut(frame)
        self._strokes.cut(moment)
        self._cut = frame if self._cut is None else min(frame, self._cut)

    def plan(self, now: float) -> list[Window]:
        """Windows that are new since the last call: up to AHEAD in announced speech, else up to SOON.

        Call it often, at least every 0.1 s. A window replaces all that was planned from its first frame on.

        Args:
            now: The present [s since the epoch].

        Returns:
            Windows in the order of time, without a gap between them; none while enough is planned.
        """
        self._end_controls(now)
        soonest = first_frame_after(now + REACT)
        if self._plan is None:
            self._plan = Plan(soonest, nearest(self._rest_poses, self._rest))
        plan = self._plan
        if plan.end < first_frame_after(now):
            self._late += 1
            plan.hold(soonest)
            self._settling = None
        plan.forget(first_frame_after(now) - LATELY)
        self.hearing.forget(soonest - 2 * WINDOW)
        if self._cut is not None:
            plan.cut(max(self._cut, first_frame_after(now + CUT_REACT)))
            self._settling, self._cut = None, None
        self._interrupt_rest(plan, soonest)

        windows: list[Window] = []
        while True:
            announced = plan.end <= self.hearing.announced
            horizon = first_frame_after(now + (AHEAD if announced else SOON))
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
                spoken = self.hearing.spoken(plan.end, frames)
                window = (self._speech(plan, spoken) if spoken else None) or self._silence(plan, frames)
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
            self._asked, self._admission = asked, self._controls.admit(*asked, self._among)

    def _interrupt_rest(self, plan: Plan, soonest: int) -> None:
        """Cut the plan where it rests, or hands retract, although somebody speaks."""
        for window in plan.windows:
            if window.source != "speech":
                first = max(window.start, soonest, self._strokes.free_from)
                for frame in range(first, window.stop):
                    begin = max(frame - ONSET, first)
                    if self.hearing.speaks(frame) and self.hearing.spoken(begin, WINDOW):
                        plan.cut(begin)
                        return

    def _speech(self, plan: Plan, frames: int) -> Window | None:
        """The window that goes on best from the last pose with the sound; None where nothing ever moves."""
        start, last = plan.end, plan.last
        if last.source == "speech":
            frame = last.frame + round(last.shown[len(last.keypoints) - 1])
            pose = self._search.pose_at(self._search.row(last.sequence, frame))
        else:
            pose = self._search.pose_of(last.keypoints[-1])
        sound = self._search.audio_of(self.hearing.sound(start))
        lately = [(seen.sequence, seen.frame) for seen in plan.windows[::-1] if seen.source == "speech"]
        mask, k = self._admission.without(lately), int(self._generator.integers(1, self._k + 1))
        match = self._search.find(pose, sound, mask, k, self._preselection)
        if match is None:
            # All that the controls leave is the very frame that is shown.
            mask = self._controls.admit((), among=self._among).mask
            match = self._search.find(pose, sound, mask, k, self._preselection)
        if match is None:
            return None
        tempo, amplitude = self._shape(match.sequence)
        row = self._search.row(match.sequence, match.frame)
        shown = self._shown(match, start, frames, tempo)
        recorded = played(self._database.keypoints, row + shown)
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
            shown=shown,
            amplitude=amplitude,
            kept=self._admission.kept,
        )

    def _shown(self, match: Match, start: int, frames: int, tempo: float) -> np.ndarray:
        """Which frames of the matched sequence a window shows, from the match on: (frames,)."""
        beats = np.array(self.hearing.beats) - start
        if not self._align_beats or any(bound.quantity == "wrist_speed" for bound in self._bounds):
            beats = beats[:0]
        first = max(0, match.frame - BEFORE)
        stop = match.frame + math.ceil((1 + STRETCH) * tempo * frames) + AFTER
        row = self._search.row(match.sequence, 0)
        recorded = self._database.keypoints[row + first : row + min(stop, SEQUENCE + LOOKAHEAD)]
        return aligned(motion_beats(recorded) + first - match.frame, beats, frames, tempo)

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
        pose, velocity = plan.pose_and_velocity()
        return Settling(plan.end - 1, pose, velocity, nearest(self._rest_poses, pose))
