"""The loops of the fast search, compiled. What they are given is described in codes.py and contest.py.

Of every sequence they find `near` and `far`, which bound a distance from below and above, and `frames`, a set
of its frames, one bit each. A sequence without a frame is out.
"""

import numpy as np
from numba import njit
from numba.cpython.unsafe.numbers import trailing_zeros

BINS = 4096
"""Of the histograms that count how many distances may lie below another one."""

_exact = njit(cache=True, nogil=True, error_model="numpy")
_free = njit(
    cache=True, nogil=True, error_model="numpy", fastmath={"contract", "reassoc", "nnan", "nsz", "arcp"}
)

_ZERO, _INF, _TINY = np.float32(0), np.float32(np.inf), np.float32(1e-12)
_ONE = np.uint64(1)


@_free
def scan_poses(coarse, fine, weights, fine_weights, fine_step, tail_weights, square, rounding, words):
    """Bounds of the smallest distance in each sequence, and the frames that may have it.

    The coarse codes bound all 64 distances, the fine ones those that may still be the smallest.
    """
    axes, squares, tails, errors = coarse
    details, fine_squares, fine_tails, fine_errors = fine
    near, far, frames = _results(len(words))
    dot, low, high = np.empty(64, np.float32), np.empty(64, np.float32), np.empty(64, np.float32)
    for s in range(len(words)):
        word = words[s]
        if word == 0:
            continue
        for f in range(64):
            dot[f] = 0
        for a in range(0, len(weights), 4):
            w0, w1, w2, w3 = weights[a], weights[a + 1], weights[a + 2], weights[a + 3]
            for f in range(64):
                dot[f] += (
                    np.float32(axes[s, a, f]) * w0
                    + np.float32(axes[s, a + 1, f]) * w1
                    + np.float32(axes[s, a + 2, f]) * w2
                    + np.float32(axes[s, a + 3, f]) * w3
                )
        for f in range(64):
            middle = squares[s, f] + square - dot[f]
            if (word >> np.uint64(f)) & _ONE == 0:
                middle = _INF
            spread = np.float32(tails[s, f]) * tail_weights[0] + rounding
            low[f], high[f] = middle - spread, middle + spread
        _, _, word = _smallest(low, high, errors[s])

        for f in range(64):
            low[f] = high[f] = _INF
        while word:
            f, word = trailing_zeros(word), word & (word - _ONE)
            fine_dot = np.float32(_product(details[s, f], fine_weights)) * fine_step
            middle = fine_squares[s, f] + square - dot[f] - fine_dot
            spread = np.float32(fine_tails[s, f]) * tail_weights[1] + rounding
            low[f], high[f] = middle - spread, middle + spread
        near[s], far[s], frames[s] = _smallest(low, high, fine_errors[s])
    return near, far, frames


@_free
def scan_frames(stored, query, words):
    """As scan_poses, of features that are stacked when they are read."""
    near, far, frames = _results(len(words))
    lows = np.empty(64, np.float32)
    for s in range(len(words)):
        lowest = highest = _INF
        word = words[s]
        while word:
            f, word = trailing_zeros(word), word & (word - _ONE)
            low, high = _bounds(stored, query, s, f)
            lows[f], lowest = low, min(lowest, low)
            if low > 0:
                highest = min(highest, high)
        word = words[s]
        while word:
            f, word = trailing_zeros(word), word & (word - _ONE)
            if lows[f] <= highest:
                frames[s] |= _ONE << np.uint64(f)
        near[s], far[s] = max(lowest, _ZERO), highest
    return near, far, frames


@_free
def compare_frames(stored, query, frames):
    """Bounds of the distance that each sequence's frame has, whichever of its set that is."""
    near, far, _ = _results(len(frames))
    for s in range(len(frames)):
        word = frames[s]
        if word == 0:
            continue
        lowest, highest = _INF, _ZERO
        while word:
            f, word = trailing_zeros(word), word & (word - _ONE)
            low, high = _bounds(stored, query, s, f)
            lowest, highest = min(lowest, low), max(highest, high)
        near[s], far[s] = lowest, highest
    return near, far


@_free
def _results(count):
    return np.full(count, np.inf), np.full(count, np.inf), np.zeros(count, np.uint64)


@_free
def _product(codes, weights):
    whole = np.int32(0)
    for i in range(len(weights)):
        whole = np.int32(whole + np.int32(np.int32(codes[i]) * np.int32(weights[i])))
    return whole


@_free
def _smallest(low, high, error):
    """Bounds of the smallest of some distances, and the bits of those that may be it.

    Given are bounds (64,) of their squares, and by how much a distance may lie beyond. A distance that may be
    0 is no bound from above, because the search skips it.
    """
    lowest, highest = _INF, _INF
    for f in range(64):
        lowest = min(lowest, low[f])
        highest = min(highest, high[f] if low[f] > error * error else _INF)
    near, far = max(np.sqrt(max(lowest, _ZERO)) - error, _ZERO), np.sqrt(highest) + error
    limit = min((far + error) ** 2, np.float32(3e38))
    frames = np.uint64(0)
    for f in range(64):
        if low[f] <= limit:
            frames |= _ONE << np.uint64(f)
    return near, far, frames


@_free
def _bounds(stored, query, s, f):
    """Bounds of the distance of frame f of sequence s."""
    codes, numbers, lengths, errors, starts = stored
    weights, step, square, lost, rounding, cosine = query
    row = starts[s] + f
    feature = codes[row & 1, (row >> 1) * numbers :]
    dot, length = np.float32(_product(feature, weights)) * step, lengths[row]
    if cosine:
        middle = (1 + square) / 2 - dot / max(length, _TINY)
        spread = errors[s] / max(length - errors[s] / 2, _TINY) + lost + rounding
        return middle - spread, middle + spread
    middle, spread = length * length + square - 2 * dot, errors[s] + lost
    low, high = max(middle - rounding, _ZERO), max(middle + rounding, _ZERO)
    return np.sqrt(low) - spread, np.sqrt(high) + spread


@_exact
def add_rank_bounds(near, far, frames, fewest, most):
    """Add the smallest and the largest rank that each sequence's distance may have to two arrays (S,)."""
    smallest, largest = np.inf, -np.inf
    for s in range(len(frames)):
        if frames[s]:
            smallest, largest = min(smallest, near[s]), max(largest, near[s])
    scale = (BINS - 1) / max(largest - smallest, 1e-30)
    begun, over = np.zeros(BINS + 1, np.int64), np.zeros(BINS + 1, np.int64)
    for s in range(len(frames)):
        if frames[s]:
            begun[_bin(near[s], smallest, scale)] += 1
            over[_bin(far[s], smallest, scale) + 1] += 1
    begun, over = begun.cumsum(), over.cumsum()
    for s in range(len(frames)):
        if frames[s]:
            fewest[s] += over[_bin(near[s], smallest, scale)]
            most[s] += begun[_bin(far[s], smallest, scale)] - 1  # all that have begun but itself


@_exact
def _bin(distance, smallest, scale):
    return np.int64(min((distance - smallest) * scale, BINS - 1.0))


@_exact
def crossing(distances, near, far, frames):
    """(S,) bool: the sequences whose bounds hold one of some distances, in rising order, between them."""
    crossed = np.zeros(len(frames), np.bool_)
    for s in range(len(frames)):
        if frames[s] and near[s] <= distances[-1]:
            crossed[s] = distances[np.searchsorted(distances, near[s])] <= far[s]
    return crossed


@_exact
def ranks_among(distances, sequences, far, frames):
    """Ranks of the distances of some sequences, in rising order, ties in the order of the sequences.

    No bounds of any other sequence may hold one of them between them; see crossing.
    """
    before = np.zeros(len(distances) + 1, np.int64)
    for s in range(len(frames)):
        if frames[s] and far[s] <= distances[-1]:
            place = np.searchsorted(distances, far[s])
            while place < len(distances) and distances[place] == far[s] and sequences[place] <= s:
                place += 1
            before[place] += 1
    return before.cumsum()[:-1]
