"""The Frechet distance of two sets of vectors, each taken for a Gaussian (Dowson and Landau 1982).

Heusel et al. 2017 (section 2) took it for pictures, Yoon et al. 2020 (section 5.1) for gestures. The distance
of two finite samples is biased upward, the more, the fewer they are. So that all systems carry the same bias,
and recorded motion does not compare with itself, the pieces are parted into two halves, at even and at odd
places: what is shown to one half is compared with what was recorded of the other. The value is the mean of
both ways. Recorded motion then has a distance, too: the floor.
"""

from collections.abc import Callable, Sequence

import numpy as np


def gaussian_sums(vectors: np.ndarray) -> np.ndarray:
    """Count, sum and sum of products of vectors (n, d), as (1 + d + d * d,) numbers that can be added up."""
    return np.concatenate([[len(vectors)], vectors.sum(axis=0), (vectors.T @ vectors).ravel()])


def gaussian(sums: np.ndarray, dimensions: int) -> tuple[np.ndarray, np.ndarray]:
    """Mean (..., d) and covariance (..., d, d) from such sums (..., 1 + d + d * d)."""
    count, total, products = np.split(sums, [1, 1 + dimensions], axis=-1)
    mean = total / count
    products = products.reshape(*products.shape[:-1], dimensions, dimensions) / count[..., None]
    return mean, products - mean[..., :, None] * mean[..., None, :]


def half_sums(shown: Sequence[np.ndarray], recorded: Sequence[np.ndarray]) -> np.ndarray:
    """Sums of p pieces, of which the even are one half and the odd the other.

    Args:
        shown: (n, d) vectors of each piece; any n.
        recorded: Likewise.

    Returns:
        (p, 4 * (1 + d + d * d)): gaussian_sums of shown and recorded if even, and of both if odd.
    """
    pairs = zip(shown, recorded, strict=True)
    both = np.array([[gaussian_sums(vectors) for vectors in pair] for pair in pairs])
    halves = np.zeros((len(both), 2, *both.shape[1:]))
    halves[0::2, 0], halves[1::2, 1] = both[0::2], both[1::2]
    return halves.reshape(len(both), -1)


def half_distance(dimensions: int) -> Callable[[np.ndarray], np.ndarray]:
    """The value of such sums: (..., 4 * (1 + d + d * d)) -> (...)."""

    def value(sums: np.ndarray) -> np.ndarray:
        even, even_recorded, odd, odd_recorded = (
            gaussian(part, dimensions) for part in np.split(sums, 4, axis=-1)
        )
        return (frechet_distance(*even, *odd_recorded) + frechet_distance(*odd, *even_recorded)) / 2

    return value


def distance(shown: Sequence[np.ndarray], recorded: Sequence[np.ndarray]) -> float:
    """Of vectors shown to the very pieces that were recorded: lists of (n, d); 0 for the same."""
    gaussians = [
        gaussian(gaussian_sums(np.concatenate(vectors)), vectors[0].shape[1]) for vectors in (shown, recorded)
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
