"""How far made motion is from real motion of the same speech, for a training to choose by."""

from collections.abc import Sequence

import numpy as np

from gesture_bot.evaluate.encoder import Encoder
from gesture_bot.evaluate.frechet import distance
from gesture_bot.evaluate.kinematics import scaled_features


def distances(made: Sequence[np.ndarray], recorded: Sequence[np.ndarray]) -> dict[str, float]:
    """FGD and the kinematic Frechet distance of motions (n, 17, 3) [m], n at least 32, by their names.

    Both are of the whole, not of two halves as in the table of systems: a few recordings are too unlike.
    """
    latents = Encoder().latents
    return {
        "FGD": distance([latents(motion) for motion in made], [latents(motion) for motion in recorded]),
        "kinematic FD": distance(*scaled_features(made, recorded)),
    }
