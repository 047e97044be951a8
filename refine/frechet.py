"""How far made motion is from real motion as a whole: a Frechet distance that needs no network."""

import numpy as np

from gesture_bot.base.keypoints import INDEX, MATCHED

_MATCHED = [INDEX[name] for name in MATCHED]


def kinematic_distance(real: np.ndarray, made: np.ndarray) -> float:
    """Frechet distance of the frames' kinematics (Heusel et al. 2017 with these in place of Inception's).

    A frame's kinematics are position, velocity and acceleration of the 8 keypoints of the pose feature, 72
    numbers, in standard deviations of the real motion.

    Args:
        real: (w, t, 17, 3) windows of keypoints [m].
        made: (v, t, 17, 3) the same.
    """
    ours, theirs = _kinematics(real), _kinematics(made)
    mean, deviation = ours.mean(axis=0), np.maximum(ours.std(axis=0), 1e-6)
    return frechet_distance((ours - mean) / deviation, (theirs - mean) / deviation)


def frechet_distance(ours: np.ndarray, theirs: np.ndarray) -> float:
    """Squared Frechet distance of two normal distributions fitted to samples (n, d) and (m, d)."""
    covariances = [np.cov(samples, rowvar=False) for samples in (ours, theirs)]
    # The trace of the root of a product of two covariances, whose eigenvalues are all real and positive.
    root = np.sqrt(np.maximum(np.linalg.eigvals(covariances[0] @ covariances[1]).real, 0)).sum()
    apart = ((ours.mean(axis=0) - theirs.mean(axis=0)) ** 2).sum()
    return float(apart + np.trace(covariances[0]) + np.trace(covariances[1]) - 2 * root)


def _kinematics(windows: np.ndarray) -> np.ndarray:
    positions = windows[:, :, _MATCHED].reshape(*windows.shape[:2], -1).astype(np.float64)
    velocities = np.diff(positions, axis=1)
    parts = positions[:, 1:-1], velocities[:, 1:], np.diff(velocities, axis=1)
    return np.concatenate(parts, axis=2).reshape(-1, 3 * positions.shape[2])
