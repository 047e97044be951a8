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
    gaussians = [
        (samples.mean(axis=0), np.cov(samples, rowvar=False))
        for samples in ((ours - mean) / deviation, (theirs - mean) / deviation)
    ]
    return float(frechet_distance(*gaussians[0], *gaussians[1]))


def frechet_distance(
    mean: np.ndarray, covariance: np.ndarray, other_mean: np.ndarray, other_covariance: np.ndarray
) -> np.ndarray:
    """Squared distance |m - n|^2 + tr(C + D - 2 (C D)^(1/2)) of Gaussians (Dowson and Landau 1982).

    Args:
        mean: (..., d) of one.
        covariance: (..., d, d) of one, symmetric.
        other_mean: (..., d) of the other.
        other_covariance: (..., d, d) of the other.
    """
    values, vectors = np.linalg.eigh(covariance)
    root = (vectors * np.sqrt(np.maximum(values, 0))[..., None, :]) @ np.swapaxes(vectors, -1, -2)
    product = np.linalg.eigvalsh(root @ other_covariance @ root)
    traces = np.trace(covariance, axis1=-2, axis2=-1) + np.trace(other_covariance, axis1=-2, axis2=-1)
    apart = ((mean - other_mean) ** 2).sum(axis=-1)
    return apart + traces - 2 * np.sqrt(np.maximum(product, 0)).sum(axis=-1)


def _kinematics(windows: np.ndarray) -> np.ndarray:
    positions = windows[:, :, _MATCHED].reshape(*windows.shape[:2], -1).astype(np.float64)
    velocities = np.diff(positions, axis=1)
    parts = positions[:, 1:-1], velocities[:, 1:], np.diff(velocities, axis=1)
    return np.concatenate(parts, axis=2).reshape(-1, 3 * positions.shape[2])
