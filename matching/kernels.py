"""The compiled loops of the fast search, in kernels.cpp.

Of every sequence they find `near` and `far`, which bound a distance from below and above, and `frames`, a set
of its frames, one bit each. Where that is empty, the sequence is out, and its bounds mean nothing.
"""

import ctypes
from pathlib import Path

import numpy as np


def _record(*members: tuple, floats: str) -> np.dtype:
    """A C structure that ends with numbers in single precision."""
    return np.dtype([*members, *((name, np.float32) for name in floats.split())])


POSE_QUERY = _record(("weights", np.int16, (8, 4, 2)), floats="step square error rest rounding")
"""A pose query in numbers that fit the codes of poses: of pairs of axes, for each of the poses stacked."""

FRAME_QUERY = _record(("weights", np.int16, 112), floats="step square error rounding")
"""A query in numbers that fit the codes of frames."""


def _load(version: str) -> ctypes.CDLL:
    return ctypes.CDLL(str(Path(__file__).parents[1] / f"libgesture_bot_search{version}.so"))


_LIBRARY = _load("")
if _LIBRARY.has_avx2():
    _LIBRARY = _load("_avx2")


def addresses(*members: np.ndarray | int) -> np.ndarray:
    """A C structure of pointers to arrays, which must be kept alive, and of 64-bit whole numbers."""
    return np.array([one.ctypes.data if isinstance(one, np.ndarray) else one for one in members], np.int64)


def pointer(array: np.ndarray | None) -> ctypes.c_void_p:
    """The address of an array, which must be kept alive, for call; None stands for no array."""
    return ctypes.c_void_p(None if array is None else array.ctypes.data)


def call(name: str, *arguments: np.ndarray | ctypes.c_void_p | int | None) -> int:
    """Call a function of kernels.cpp. What it returns, if anything, is an int."""
    passed = [ctypes.c_int64(one) if isinstance(one, int) else one for one in arguments]
    passed = [pointer(one) if isinstance(one, np.ndarray) else one for one in passed]
    return int(getattr(_LIBRARY, name)(*passed))
