"""A small database for the tests of matching: smooth composed motion in three moods, smooth random sound."""

import numpy as np
from scipy.ndimage import gaussian_filter1d

from gesture_bot.corpus.body import Posture, pose
from gesture_bot.corpus.database import Database
from gesture_bot.corpus.recordings import Recording, build_database
from gesture_bot.speech.features import COEFFICIENTS, FEATURES

MOODS = {"neutral": (0.20, 5.0), "sad": (0.10, 9.0), "angry": (0.25, 2.5)}
"""Height of the hands over the pelvis [m], and how slowly they move [frames]."""

LOUD, SILENT = -20.0, -60.0


def smooth(generator: np.random.Generator, frames: int, numbers: int, sigma: float) -> np.ndarray:
    """Random curves of about unit size."""
    noise = gaussian_filter1d(generator.normal(size=(frames, numbers)), sigma, axis=0, mode="wrap")
    return noise / noise.std(axis=0)


def motion(generator: np.random.Generator, frames: int, height: float, sigma: float) -> np.ndarray:
    """(frames, 17, 3) hands that wander about."""
    centre = np.array([0.28, 0.18, height, 0.3, 0.0])
    hands = [centre + 0.06 * smooth(generator, frames, 5, sigma) for _ in range(2)]
    sway = 0.03 * smooth(generator, frames, 6, 15.0)
    return pose(Posture(hands[0], hands[1], sway[:, :3], sway[:, 3:], 0.2))


def sound(generator: np.random.Generator, frames: int) -> np.ndarray:
    """(frames, 28) features, the last third silent."""
    features = smooth(generator, frames, FEATURES, 2.0)
    features[:, COEFFICIENTS] = np.where(np.arange(frames) < 2 * frames / 3, LOUD, SILENT)
    return features.astype(np.float32)


def small_database(seed: int = 0, recordings: int = 12, frames: int = 200) -> Database:
    """Recordings in turn of each mood; the last one says and does the same as the first."""
    generator = np.random.default_rng(seed)
    made = []
    for number in range(recordings - 1):
        mood = list(MOODS)[number % len(MOODS)]
        moved = motion(generator, frames, *MOODS[mood])
        made.append(Recording(f"number {number}", moved, sound(generator, frames), {"emotion": mood}))
    return build_database([*made, made[0]], {})
