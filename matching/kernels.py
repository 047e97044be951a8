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


POSE_QUERY = _record(("weights", np.int16, (4, 24)), floats="step square error rounding")
"""A pose query in numbers that fit the codes of poses."""

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


def call(name: str, *arguments: np.ndarray | int | None) -> int:
    """Call a function of kernels.cpp; None stands for no array. What it returns, if anything, is an int."""
    passed = [ctypes.c_int64(one) if isinstance(one, int) else _pointer(one) for one in arguments]
    return int(_LIBRARY[name](*passed))


def _pointer(array: np.ndarray | None) -> ctypes.c_void_p:
    return ctypes.c_void_p(None if array is None else array.ctypes.data)


def eligible_words(mask: np.ndarray) -> np.ndarray:
    """(S,) uint64 bits of the frames at which a window may begin, from a mask (S, 64) of bool."""
    words = np.empty(len(mask), np.uint64)
    call("eligible_words", np.ascontiguousarray(mask, bool), len(mask), words)
    return words
