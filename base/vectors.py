"""Lengths, directions and perpendicular parts of vectors along the last axis."""

import numpy as np


def length(vectors: np.ndarray) -> np.ndarray:
    """Lengths (..., 1) of vectors (..., d)."""
    return np.linalg.norm(vectors, axis=-1, keepdims=True)


def unit(vectors: np.ndarray) -> np.ndarray:
    """Vectors (..., d) at length 1; one without a length stays 0."""
    return vectors / np.maximum(length(vectors), 1e-9)


def across(vectors: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """The part of vectors (..., d) across unit vectors (..., d)."""
    return vectors - np.sum(vectors * axis, axis=-1, keepdims=True) * axis
