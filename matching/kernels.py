"""The compiled search, kernels.cpp, and the structures that it reads."""

import ctypes
from pathlib import Path

import numpy as np

PAIRS = 10
"""Pairs of coded numbers of a pose."""

POSE_CODES = np.dtype([(name, np.uint64) for name in ("codes", "squares", "errors", "rests")])
"""Addresses of the arrays of codes.PoseCodes."""

POSE_QUERY = np.dtype(
    [
        ("weights", np.int16, (PAIRS, 4, 2)),
        *((name, np.float32) for name in ("step", "square", "rest", "rounding")),
    ]
)
"""A pose feature in numbers that fit these codes: of each pair, for each of the poses stacked."""

FRAME_CODES = np.dtype(
    [
        *((name, np.uint64) for name in ("codes", "lengths", "errors")),
        *((name, np.float32) for name in ("step", "rounding")),
    ]
)
"""Addresses of the arrays of codes.FrameCodes, and their scale."""

FRAME_QUERY = np.dtype(
    [
        ("weights", np.int16, 112),
        *((name, np.float32) for name in ("step", "square", "error", "rounding")),
    ]
)
"""A feature, (96,) of poses or (112,) of sounds, in whole numbers."""


def _load(version: str) -> ctypes.CDLL:
    return ctypes.CDLL(str(Path(__file__).parents[1] / f"libgesture_bot_search{version}.so"))


_LIBRARY = _load("")
if _LIBRARY.has_avx2():
    _LIBRARY = _load("_avx2")


def call(name: str, *arguments: np.ndarray | int | None) -> None:
    """Call a function of kernels.cpp; None stands for no array."""
    getattr(_LIBRARY, name)(*map(_passed, arguments))


def _passed(argument: np.ndarray | int | None) -> ctypes.c_int64 | ctypes.c_void_p:
    if isinstance(argument, np.ndarray):
        return ctypes.c_void_p(argument.ctypes.data)
    return ctypes.c_void_p() if argument is None else ctypes.c_int64(argument)
