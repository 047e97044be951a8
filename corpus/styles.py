"""How an emotion moves and speaks: size, place, tempo and rhythm of gestures, carriage of the body, voice.

Sad and bored people move little, low and slowly; joy is high and wide; anger is fast, large, abrupt and
forward. That emotions differ in the amount, the extent and the force of movement is Wallbott's finding
(Bodily expression of emotion, 1998); how their voices differ, Scherer's (Vocal communication of emotion,
2003). The numbers are ours.
"""

from dataclasses import dataclass, replace

import numpy as np

from gesture_bot.speech.voice import Manner


@dataclass(frozen=True)
class Style:
    """Parameters of one speaker's motion in one mood.

    Attributes:
        voice: How it speaks.
        size: Scale of every stroke's path.
        height: Of the centre of gesture space over the pelvis [m].
        width: How far outward it is [m].
        prepare, stroke, retract: Seconds that each phase lasts.
        hold: Longest hold before the hands go back to rest [s].
        peak: Top speed of the wrist [m/s].
        interval: Shortest time between two strokes [s].
        both: Share of gesture units made with two hands.
        even: Share of two-handed units whose hands do quite the same.
        beats: Share of other stressed words that get a small beat.
        abrupt: Pre-stroke hold [s]; negative where preparation flows into the stroke.
        rest: Wrist at rest: x forward, y outward, z over the pelvis [m].
        lean: Of the torso, forward [rad].
        head: Pitch of the head, down [rad].
        elbows: How far the elbows point outward, 0 to 1.
        forms: Name and weight of the forms used.
    """

    voice: Manner
    size: float
    height: float
    width: float
    prepare: float
    stroke: float
    retract: float
    hold: float
    peak: float
    interval: float
    both: float
    even: float
    beats: float
    abrupt: float
    rest: tuple[float, float, float]
    lean: float
    head: float
    elbows: float
    forms: dict[str, float]


STYLES = {
    "neutral": Style(
        voice=Manner(),
        size=0.95,
        height=0.24,
        width=0.2,
        prepare=0.55,
        stroke=0.36,
        retract=0.9,
        hold=1.0,
        peak=1.2,
        interval=1.1,
        both=0.45,
        even=0.6,
        beats=0.5,
        abrupt=-0.08,
        rest=(0.20, 0.10, 0.06),
        lean=0.0,
        head=0.0,
        elbows=0.2,
        forms={
            "beat": 3,
            "sweep": 2,
            "offer": 3,
            "lateral": 2,
            "point": 1,
            "circle": 1,
            "close": 1,
            "rise": 1,
        },
    ),
    "happy": Style(
        voice=Manner(speed=1.08, pitch=1.08, energy=1.1),
        size=1.2,
        height=0.32,
        width=0.24,
        prepare=0.5,
        stroke=0.34,
        retract=0.8,
        hold=0.9,
        peak=1.5,
        interval=1.0,
        both=0.6,
        even=0.7,
        beats=0.6,
        abrupt=-0.1,
        rest=(0.21, 0.11, 0.09),
        lean=-0.03,
        head=-0.08,
        elbows=0.28,
        forms={"open": 4, "rise": 3, "offer": 3, "sweep": 2, "circle": 2, "self": 1, "beat": 1},
    ),
    "excited": Style(
        voice=Manner(speed=1.18, pitch=1.12, energy=1.3),
        size=1.3,
        height=0.33,
        width=0.23,
        prepare=0.34,
        stroke=0.25,
        retract=0.6,
        hold=0.6,
        peak=1.95,
        interval=0.6,
        both=0.65,
        even=0.6,
        beats=0.8,
        abrupt=-0.06,
        rest=(0.24, 0.11, 0.13),
        lean=0.04,
        head=-0.05,
        elbows=0.32,
        forms={"open": 3, "rise": 3, "point": 2, "circle": 3, "beat": 3, "sweep": 2, "lateral": 1},
    ),
    "surprised": Style(
        voice=Manner(speed=1.06, pitch=1.12, energy=1.1),
        size=1.15,
        height=0.33,
        width=0.22,
        prepare=0.36,
        stroke=0.28,
        retract=1.0,
        hold=1.4,
        peak=2.0,
        interval=1.3,
        both=0.7,
        even=0.8,
        beats=0.3,
        abrupt=0.0,
        rest=(0.20, 0.12, 0.08),
        lean=-0.06,
        head=-0.06,
        elbows=0.28,
        forms={"open": 4, "rise": 4, "self": 2, "push": 2, "offer": 2},
    ),
    "angry": Style(
        voice=Manner(speed=1.12, pitch=1.05, energy=1.35),
        size=1.3,
        height=0.29,
        width=0.2,
        prepare=0.32,
        stroke=0.21,
        retract=0.5,
        hold=0.7,
        peak=2.1,
        interval=0.6,
        both=0.5,
        even=0.6,
        beats=0.9,
        abrupt=0.07,
        rest=(0.18, 0.17, 0.03),
        lean=0.1,
        head=0.02,
        elbows=0.3,
        forms={"chop": 5, "point": 3, "push": 3, "beat": 3, "sweep": 2, "lateral": 1},
    ),
    "sad": Style(
        voice=Manner(speed=0.86, pitch=0.94, energy=0.75),
        size=0.5,
        height=0.12,
        width=0.14,
        prepare=1.0,
        stroke=0.7,
        retract=1.5,
        hold=1.6,
        peak=0.55,
        interval=2.2,
        both=0.35,
        even=0.7,
        beats=0.2,
        abrupt=-0.2,
        rest=(0.17, 0.09, -0.01),
        lean=0.13,
        head=0.25,
        elbows=0.1,
        forms={"offer": 4, "self": 2, "beat": 2, "lateral": 1, "close": 1, "rise": 1},
    ),
    "bored": Style(
        voice=Manner(speed=0.92, pitch=0.95, energy=0.8),
        size=0.6,
        height=0.13,
        width=0.22,
        prepare=0.85,
        stroke=0.55,
        retract=1.2,
        hold=0.8,
        peak=0.7,
        interval=1.9,
        both=0.25,
        even=0.4,
        beats=0.2,
        abrupt=-0.15,
        rest=(0.11, 0.20, -0.02),
        lean=0.04,
        head=0.12,
        elbows=0.15,
        forms={"sweep": 3, "offer": 3, "circle": 3, "lateral": 2, "beat": 1},
    ),
}
"""Style of each emotion: labels of hri_msgs/Expression."""

PITCHES, LEVELS = (0.86, 1.16), (-6.0, 2.0)
"""How far the voices of one emotion differ: factor of the pitch, and level [dB]."""

HANGING, FOLDED = np.array([0.08, 0.21, -0.04]), np.array([0.23, 0.08, 0.09])
"""Two ways to rest the hands, between which people differ: wrist as in Style.rest [m]."""


def varied(emotion: str, count: int, seed: int) -> list[Style]:
    """As many styles of one emotion, spread evenly over what it allows.

    Low and high, small and large, slow and fast, narrow and wide, one-handed and two-handed variants of every
    emotion are what the motion controls choose from. With low and high, soft and loud voices, what is
    chosen hangs less on one voice.
    """
    generator = np.random.default_rng([seed, list(STYLES).index(emotion)])
    ranks = np.stack([generator.permutation(count) for _ in range(9)], axis=1)
    return [_variant(STYLES[emotion], *row) for row in (ranks + 0.5) / count]


def _variant(
    style: Style,
    size: float,
    height: float,
    tempo: float,
    width: float,
    both: float,
    even: float,
    rest: float,
    pitch: float,
    level: float,
) -> Style:
    """One variant; each argument from 0 to 1."""
    pace = 1.25 - 0.45 * tempo
    towards = FOLDED if rest > 0.5 else HANGING
    return replace(
        style,
        voice=style.voice.times(
            Manner(
                speed=0.95 + 0.1 * tempo,
                pitch=PITCHES[0] * (PITCHES[1] / PITCHES[0]) ** pitch,
                energy=10 ** ((LEVELS[0] + (LEVELS[1] - LEVELS[0]) * level) / 20),
            )
        ),
        size=style.size * (0.70 + 0.65 * size),
        height=style.height - 0.11 + 0.23 * height,
        width=style.width - 0.07 + 0.16 * width,
        prepare=style.prepare * pace,
        stroke=style.stroke * pace,
        retract=style.retract * pace,
        interval=style.interval * pace,
        both=np.clip(style.both + 1.2 * (both - 0.5), 0.0, 1.0),
        even=np.clip(style.even + 1.2 * (even - 0.5), 0.0, 1.0),
        rest=tuple(style.rest + 0.8 * abs(2 * rest - 1) * (towards - style.rest)),
    )
