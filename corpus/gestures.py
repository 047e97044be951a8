"""From stressed words to gestures: which words get a stroke, and when each phase begins and ends.

A gesture unit is preparation, stroke, hold, perhaps more strokes, and retraction (Kendon 2004; McNeill 1992).
Here a stroke ends on the stressed syllable of its word.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from gesture_bot.corpus.forms import FORMS, Target, place
from gesture_bot.corpus.movement import PEAK, Submovement, path
from gesture_bot.corpus.styles import Style

RIGHT_HANDED = 0.65
"""Share of one-handed gesture units made with the right hand."""

KEPT_UP = 0.5
"""Share of sentences after which the hands stay up for the next one."""

EVEN, UNEVEN = (0.92, 1.0), (0.3, 0.7)
"""What the second hand does of the first one's stroke: least and most."""

LOWER = 0.15
LAG = 0.12
"""How much lower [m] and later [s] the second hand would be if its share of a stroke were nothing."""

SETTLE = 0.12
"""Least time that a hand rests where a stroke ended [s]."""

SINKING = np.array([-0.01, 0.0, -0.03, -0.1, 0.1])
"""How far a held hand sinks; its units are those of a hand in corpus/body.py."""

FIDGET = 4.0
"""Seconds of idling from one small shift of the resting hands to the next."""


@dataclass
class Plan:
    """Submovements of one recording, and the moments at which its strokes end [s]."""

    left: list[Submovement] = field(default_factory=list)
    right: list[Submovement] = field(default_factory=list)
    torso: list[Submovement] = field(default_factory=list)
    head: list[Submovement] = field(default_factory=list)
    strokes: list[float] = field(default_factory=list)


def rest_state(style: Style) -> np.ndarray:
    """A hand at rest; see corpus/body.py."""
    return np.array([*style.rest, 0.6, 0.15])


def plan_gestures(
    sentences: Sequence[Sequence[float]], end: float, style: Style, generator: np.random.Generator
) -> Plan:
    """Gestures for one recording.

    Args:
        sentences: For each sentence, the moments of its stressed syllables that may carry a stroke [s].
        end: Of the recording [s].
        style: How to move.
        generator: Source of every choice.
    """
    speaker = _Speaker(style, generator)
    for sentence in filter(None, sentences):
        speaker.idle(sentence[0])
        speaker.look(sentence[0])
        for stress in sentence:
            speaker.stress(stress)
        if generator.random() > KEPT_UP:
            speaker.retract()
    speaker.retract()
    speaker.idle(end)
    return speaker.plan


class _Speaker:
    """The state of the body while a recording is planned from its start to its end."""

    def __init__(self, style: Style, generator: np.random.Generator):
        self.style, self.generator = style, generator
        self.plan = Plan()
        self.hands = {"left": self.plan.left, "right": self.plan.right}
        self.at = dict.fromkeys(self.hands, rest_state(style))
        self.sizes: dict[str, float] = {}  # of the hands in use: 1 leads, less follows
        self.gaze = np.zeros(3)
        self.free = 0.0
        self.last_stroke = -np.inf

    def stress(self, moment: float) -> None:
        """A stressed syllable: a stroke where there is time for one, else perhaps a small beat."""
        style, generator = self.style, self.generator
        if moment - self.last_stroke > style.interval * generator.uniform(0.8, 1.3) and self._stroke(moment):
            self.last_stroke = moment
        elif self.sizes and moment - self._beat_time() > self.free and generator.random() < style.beats:
            self._beat(moment)
        else:
            return
        self.free = moment + SETTLE
        self._nod(moment)

    def retract(self) -> None:
        """The hands go back to rest after a hold, if they are up."""
        if not self.sizes:
            return
        rest = rest_state(self.style)
        start = self.free + self.style.hold * self.generator.uniform(0.3, 1.0)
        reach = max(_distance(rest, self.at[side]) for side in self.sizes)
        lasts = max(self.style.retract, PEAK * reach / self.style.peak)
        for side in self.sizes:
            self._reach(side, start, start + lasts, rest)
        self.plan.torso.append(Submovement(start, start + lasts, np.zeros(3)))
        # The next unit may begin before the hands have quite settled.
        self.free = start + 0.6 * lasts
        self.sizes = {}

    def idle(self, until: float) -> None:
        """While nothing is said, the resting hands shift a little now and then."""
        while not self.sizes and until - self.free > FIDGET:
            start = self.free + self.generator.uniform(0.2, 0.4) * FIDGET
            for side in self.hands:
                shift = self.generator.normal(0, (0.012, 0.012, 0.012, 0.1, 0.05))
                self._reach(side, start, start + 1.2, rest_state(self.style) + shift)
            self.look(start)
            self.free = start + 1.2

    def look(self, moment: float) -> None:
        """The gaze moves on."""
        self.gaze = np.array([0.0, 0.0, self.generator.normal(0, 0.15)])
        self.plan.head.append(Submovement(moment - 0.3, moment + 0.3, self.gaze))

    def _stroke(self, moment: float) -> bool:
        """Plan a stroke that ends at a moment, unless the hands would have to hurry too much."""
        style, generator = self.style, self.generator
        sizes = self.sizes or self._choose_hands()
        weights = np.array([*style.forms.values()]) / sum(style.forms.values())
        form = FORMS[generator.choice([*style.forms], p=weights)]
        centre = np.array([0.27, style.width, style.height]) + generator.normal(0, (0.02, 0.025, 0.025))
        size = style.size * generator.uniform(0.8, 1.15)
        targets = {}
        for side, share in sizes.items():
            low = np.array([0.0, 0.0, LOWER * (1 - share)])
            second = side != next(iter(sizes))
            targets[side] = place(form, centre - low, size * share, mirrored=not (second and form.follows))
        reach = max(_distance(target.prepare, self.at[side]) for side, target in targets.items())
        least_stroke = PEAK * max(map(_stroke_length, targets.values())) / style.peak
        least_prepare = max(PEAK * reach / style.peak, 0.75 * style.prepare)
        stroke = max(style.stroke * generator.uniform(0.9, 1.1), least_stroke)
        prepare = max(style.prepare * generator.uniform(0.9, 1.2), least_prepare)
        ready = moment - stroke - style.abrupt
        if ready - self.free < least_prepare:
            return False

        start = max(ready - prepare, self.free)
        for side, target in targets.items():
            lag = LAG * (1 - sizes[side])
            self._reach(side, start + lag, ready + lag, target.prepare)
            self._reach(side, moment - stroke + lag, moment + lag, target.stroke, target.bow, target.curl)
            # Nobody holds a hand quite still: it sinks a little.
            self._reach(side, moment + 0.15, moment + 1.5, target.stroke + style.size * SINKING)
        turn = sizes.get("left", 0.0) - sizes.get("right", 0.0)
        lean = generator.uniform(0.0, 0.04) * style.size
        self.plan.torso.append(Submovement(start, moment, np.array([0.0, lean, 0.07 * turn * style.size])))
        self.plan.strokes.append(moment)
        self.sizes = sizes
        return True

    def _choose_hands(self) -> dict[str, float]:
        """The hands of a new gesture unit, and the size of what each does."""
        leading = "right" if self.generator.random() < RIGHT_HANDED else "left"
        sizes = {leading: 1.0}
        if self.generator.random() < self.style.both:
            even = self.generator.random() < self.style.even
            other = "left" if leading == "right" else "right"
            sizes[other] = self.generator.uniform(*(EVEN if even else UNEVEN))
        return sizes

    def _beat(self, moment: float) -> None:
        """A small up and down of the hands where they are (McNeill's beat), ending at a moment."""
        lasts = self._beat_time()
        lift = np.array([0.0, 0.0, 0.065 * self.style.size, 0.0, -0.25])
        drift = self.generator.normal(0, (0.01, 0.0, 0.015, 0.05, 0.05))
        for side, share in self.sizes.items():
            back = self.at[side] + drift
            self._reach(side, moment - lasts, moment - 0.4 * lasts, self.at[side] + share * lift)
            self._reach(side, moment - 0.55 * lasts, moment, back)

    def _beat_time(self) -> float:
        return max(0.3, self.style.stroke)

    def _nod(self, moment: float) -> None:
        """The head dips on a stressed syllable."""
        depth = self.generator.uniform(0.03, 0.10) * self.style.size
        self.plan.head.append(Submovement(moment - 0.25, moment, self.gaze + (0.0, depth, 0.0)))
        self.plan.head.append(Submovement(moment, moment + 0.45, self.gaze))

    def _reach(
        self,
        side: str,
        start: float,
        end: float,
        goal: np.ndarray,
        bow: np.ndarray | float = 0.0,
        curl: np.ndarray | float = 0.0,
    ) -> None:
        self.hands[side].append(Submovement(start, end, goal, bow, curl))
        self.at[side] = goal


def _distance(hand: np.ndarray, other: np.ndarray) -> float:
    """Between the wrists of two hand states [m]."""
    return float(np.linalg.norm((hand - other)[:3]))


def _stroke_length(target: Target) -> float:
    """Length of the wrist's path in a stroke [m]."""
    stroke = Submovement(0.0, 1.0, target.stroke, target.bow, target.curl)
    points = path(np.linspace(0.0, 1.0, 20), target.prepare, [stroke])[:, :3]
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
