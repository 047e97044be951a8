"""Large databases for tests and benchmarks of the search: smooth random motion and sound.

The matched keypoints follow 24 random curves, low-pass filtered at 0.6 Hz and correlated, with a tracking
noise of 1%: their stacked features keep more of their variance beyond their first 8 to 48 principal axes than
those of the demo corpus do (`make bench-search` prints both), so a search finds them harder. The sound is
filtered at 1.5 Hz.
"""

import numpy as np
from scipy.signal import butter, sosfilt

from gesture_bot.base.keypoints import INDEX, MATCHED
from gesture_bot.corpus.database import LABELS, LOOKAHEAD, SEQUENCE, Database
from gesture_bot.speech.features import FEATURES, STATIC


def large_database(sequences: int, repeated: int = 0, seed: int = 0) -> Database:
    """A database of one recording, whose last sequences repeat the first ones."""
    generator = np.random.default_rng(seed)
    frames = sequences * SEQUENCE + LOOKAHEAD
    motion = _curves(generator, frames, 24, cutoff=0.6, decay=0.83)
    motion += 0.01 * generator.standard_normal(motion.shape, np.float32)
    sound = _curves(generator, frames, STATIC, cutoff=1.5, decay=0.93)
    for curves in (motion, sound):
        copied = repeated * SEQUENCE
        curves[frames - LOOKAHEAD - copied :] = curves[: copied + LOOKAHEAD]

    keypoints, features = np.zeros((frames, 17, 3), np.float32), np.zeros((frames, FEATURES), np.float32)
    keypoints[:, [INDEX[name] for name in MATCHED]] = motion.reshape(frames, -1, 3)
    features[:, :STATIC] = sound
    return Database(
        keypoints,
        features,
        np.arange(sequences) * SEQUENCE,
        np.zeros(sequences, np.int32),
        np.full((sequences, len(LABELS)), -1, np.int16),
        *_statistics(keypoints),
        *_statistics(features),
        {kind: () for kind in LABELS},
    )


def random_mask(generator: np.random.Generator, sequences: int, share: float) -> np.ndarray:
    """(S, 64) bool: scattered frames, or runs of frames, as a control would leave them."""
    run = generator.choice([1, 8])
    return np.repeat(generator.random((sequences, SEQUENCE // run)), run, axis=1) < share


def _curves(
    generator: np.random.Generator, frames: int, numbers: int, cutoff: float, decay: float
) -> np.ndarray:
    """(frames, numbers) smooth curves [cutoff in Hz], mixed so that their variances fall by a factor."""
    noise = generator.standard_normal((frames, numbers), np.float32)
    low_pass = butter(2, cutoff, fs=15, output="sos").astype(np.float32)
    smooth = sosfilt(low_pass, noise, axis=0)
    smooth *= decay ** np.arange(numbers, dtype=np.float32) / smooth.std(axis=0)
    return smooth @ np.linalg.qr(generator.standard_normal((numbers, numbers)))[0].astype(np.float32)


def _statistics(numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    deviation = numbers.std(axis=0, dtype=np.float64)
    return numbers.mean(axis=0, dtype=np.float64), np.where(deviation > 0, deviation, 1.0)
