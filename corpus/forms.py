"""Forms of a stroke: where the hand prepares, where the stroke ends, and how the palm turns."""

from dataclasses import dataclass

import numpy as np

PALM_UP, PALM_DOWN, PALM_IN = -1.2, 1.1, 0.15
"""Roll of the forearm [rad]."""

NEAREST, FARTHEST = np.array([0.18, -0.15, -0.05]), np.array([0.46, 0.46, 0.54])
"""Gesture space of the wrist [m]: before the trunk, from the hips to the chin."""

OWN_SIDE = 0.075
"""Where mirrored hands meet: a wrist's least distance from the middle [m]."""


@dataclass(frozen=True)
class Form:
    """One form, made by the left hand: x forward, y outward, z up.

    Attributes:
        prepare, stroke: Where the wrist is before and after the stroke [m], from the centre of gesture space.
        rolls, flexes: Forearm roll and wrist flexion before and after [rad]; see corpus/body.py.
        bow, curl: How the stroke's path bends [m]; see corpus/movement.py.
        follows: With two hands, whether the other goes the same way instead of mirroring.
    """

    prepare: tuple[float, float, float]
    stroke: tuple[float, float, float]
    rolls: tuple[float, float]
    flexes: tuple[float, float] = (0.0, 0.0)
    bow: tuple[float, float, float] = (0.0, 0.0, 0.0)
    curl: tuple[float, float, float] = (0.0, 0.0, 0.0)
    follows: bool = False


FORMS = {
    "beat": Form((-0.02, 0.00, 0.13), (0.05, 0.03, -0.05), (0.7, PALM_DOWN), (-0.3, 0.2), bow=(0.03, 0, 0)),
    "chop": Form((-0.03, 0.02, 0.17), (0.09, -0.02, -0.08), (PALM_IN, 0.0), (-0.1, 0.1), bow=(0.04, 0, 0)),
    "sweep": Form((0.02, -0.16, 0.04), (0.03, 0.18, 0.00), (0.8, 0.2), (0.2, -0.3), bow=(0.06, 0, 0.03)),
    "lateral": Form((0.00, 0.08, 0.05), (0.04, -0.17, 0.01), (0.2, 0.8), bow=(0.05, 0, 0.02), follows=True),
    "offer": Form((-0.06, -0.07, 0.04), (0.12, 0.06, -0.02), (0.1, PALM_UP), (0.2, -0.1), bow=(0, 0, -0.05)),
    "point": Form((-0.08, 0.02, 0.06), (0.20, -0.02, 0.08), (0.6, PALM_DOWN), (0.3, 0.0), bow=(0, 0, 0.03)),
    "rise": Form((0.03, 0.00, -0.09), (0.04, 0.06, 0.20), (-0.7, PALM_UP), (0.2, -0.3), bow=(0.03, 0, 0)),
    "open": Form((0.04, -0.15, 0.06), (0.02, 0.22, 0.07), (PALM_IN, -0.7), (0.2, -0.2), bow=(0.05, 0, 0.05)),
    "close": Form((0.00, 0.16, 0.05), (0.06, -0.10, 0.00), (0.0, PALM_IN), (-0.2, 0.1), bow=(0.03, 0, 0)),
    "push": Form((-0.10, -0.02, 0.04), (0.15, 0.03, 0.07), (PALM_DOWN, 1.3), (-0.5, -0.9)),
    "circle": Form((0.02, -0.03, 0.08), (0.05, 0.03, 0.05), (0.6, 0.4), bow=(0, 0, -0.16), curl=(0, 0.16, 0)),
    "self": Form((0.03, 0.05, 0.02), (-0.10, -0.17, 0.09), (0.2, 0.4), (0.0, 0.4), bow=(0.04, 0, 0)),
}


@dataclass(frozen=True)
class Target:
    """A form at a place and size: a hand's states before and after the stroke, and the bend of its path."""

    prepare: np.ndarray
    stroke: np.ndarray
    bow: np.ndarray
    curl: np.ndarray


def place(form: Form, centre: np.ndarray, size: float, mirrored: bool) -> Target:
    """A form around a centre [m] and at a size (1 as listed).

    Args:
        form: The form.
        centre: (3,) middle of the hand's gesture space [m], y outward.
        size: Scale of the path.
        mirrored: False where this hand moves the way the other one does.
    """
    scale = size * np.array([1.0, 1.0 if mirrored else -1.0, 1.0])
    nearest = np.array([NEAREST[0], OWN_SIDE if mirrored else NEAREST[1], NEAREST[2]])

    def state(offset: tuple[float, float, float], roll: float, flex: float) -> np.ndarray:
        return np.array([*np.clip(centre + scale * offset, nearest, FARTHEST), roll, flex])

    def bend(offset: tuple[float, float, float]) -> np.ndarray:
        return np.array([*(scale * offset), 0.0, 0.0])

    return Target(
        state(form.prepare, form.rolls[0], form.flexes[0]),
        state(form.stroke, form.rolls[1], form.flexes[1]),
        bend(form.bow),
        bend(form.curl),
    )
