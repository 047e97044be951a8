"""The compiled search, kernels.cpp."""

import ctypes
from collections.abc import Sequence
from pathlib import Path

import numpy as np


def _load(version: str) -> ctypes.CDLL:
    return ctypes.CDLL(str(Path(__file__).parents[1] / f"libgesture_bot_search{version}.so"))


_LIBRARY = _load("")
if _LIBRARY.has_avx2():
    _LIBRARY = _load("_avx2")


def table(arrays: Sequence[np.ndarray], *numbers: float) -> np.ndarray:
    """A C structure of pointers to arrays, which must be kept alive, and of numbers in double precision."""
    pointers = np.array([array.ctypes.data for array in arrays], np.uint64)
    return np.concatenate([pointers, np.array(numbers).view(np.uint64)])


def call(name: str, *arguments: np.ndarray | int | None) -> int:
    """Call a function of kernels.cpp; None stands for no array. What it returns, if anything, is an int."""
    return int(getattr(_LIBRARY, name)(*map(_passed, arguments)))


def _passed(argument: np.ndarray | int | None) -> ctypes.c_int64 | ctypes.c_void_p:
    if isinstance(argument, np.ndarray):
        return ctypes.c_void_p(argument.ctypes.data)
    return ctypes.c_void_p() if argument is None else ctypes.c_int64(argument)
