"""From recordings to a database: cutting them into sequences, each with its future, and their statistics."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.keypoints import KEYPOINTS
from gesture_bot.corpus.database import LABELS, LOOKAHEAD, SEQUENCE, Database
from gesture_bot.speech.features import FEATURES, SILENCE_FEATURES

Future = Literal["real", "zeros"]

_BLOCK = 100_000
_CONSTANT = 1e-6


@dataclass(frozen=True)
class Recording:
    """One person speaking and gesturing.

    Attributes:
        name: What errors call it.
        keypoints: (n, 17, 3) positions [m], pelvis frame, at 15 frames a second.
        features: (m, 28) speech features of the same frames, m >= n; see speech/features.py. Those after the
            last keypoints are the sound that follows.
        labels: By kind, one of database.LABELS. Emotions are labels of hri_msgs/Expression.
    """

    name: str
    keypoints: np.ndarray
    features: np.ndarray
    labels: Mapping[str, str] = field(default_factory=dict)


def build_database(
    recordings: Iterable[Recording], metadata: dict[str, Any], future: Future = "real"
) -> Database:
    """Cut recordings into sequences of 64 frames, end to end, the last one ending with its recording.

    After the last keypoints of every recording the speaker holds still for LOOKAHEAD frames, and before them
    for as long as a recording that is shorter than a sequence takes to fill one. The sound goes on as it did,
    and then is silent.

    Args:
        recordings: In the order of the database.
        metadata: See Database.
        future: `real`: the frames after a sequence are those that followed. `zeros`: every sequence is stored
            alone, and the features after it are 0 when z-scored, as in the authors' code of MM22.

    Raises:
        InvalidValueError: A recording is empty or not finite, its features do not cover its keypoints, its
            kind of label is unknown, or there is no recording.
    """
    keypoints: list[np.ndarray] = []
    features: list[np.ndarray] = []
    starts: list[int] = []
    number: list[int] = []
    labels: list[list[int]] = []
    names: dict[str, list[str]] = {kind: [] for kind in LABELS}
    begin = 0
    for index, recording in enumerate(recordings):
        _check(recording)
        moving, heard = _with_future(recording)
        length = len(moving) - LOOKAHEAD
        cuts = [*range(0, length - SEQUENCE, SEQUENCE), length - SEQUENCE]
        stored = [slice(None)]
        if future == "zeros":
            stored = [slice(cut, cut + SEQUENCE + LOOKAHEAD) for cut in cuts]
            starts += [begin + place * (SEQUENCE + LOOKAHEAD) for place in range(len(cuts))]
        else:
            starts += [begin + cut for cut in cuts]
        keypoints += [moving[rows] for rows in stored]
        features += [heard[rows] for rows in stored]
        begin += sum(map(len, keypoints[-len(stored) :]))
        number += [index] * len(cuts)
        labels += [[_index(names[kind], recording.labels.get(kind, "")) for kind in LABELS]] * len(cuts)
    if not starts:
        raise InvalidValueError("no recording to build a database from")
    return _with_statistics(
        _joined(keypoints),
        _joined(features),
        np.array(starts, np.int64),
        future,
        recording=np.array(number, np.int32),
        labels=np.array(labels, np.int16),
        names={kind: tuple(known) for kind, known in names.items()},
        metadata=metadata,
    )


def _with_future(recording: Recording) -> tuple[np.ndarray, np.ndarray]:
    """Keypoints and features of at least one sequence, and of the LOOKAHEAD frames that follow."""
    frames = len(recording.keypoints)
    length = max(frames, SEQUENCE) + LOOKAHEAD
    still = np.repeat(recording.keypoints[-1:], length - frames, axis=0)
    heard = recording.features[:length]
    silence = np.tile(SILENCE_FEATURES, (length - len(heard), 1))
    return (
        np.concatenate([recording.keypoints, still]).astype(np.float32),
        np.concatenate([heard, silence]).astype(np.float32),
    )


def _joined(parts: list[np.ndarray]) -> np.ndarray:
    """The parts as one array. They are given up: twice all the data is a lot of memory."""
    whole = np.concatenate(parts)
    parts.clear()
    return whole


def _index(names: list[str], name: str) -> int:
    """The place of a name, which is added where it is new; -1 for an empty one."""
    if name and name not in names:
        names.append(name)
    return names.index(name) if name else -1


def _with_statistics(
    keypoints: np.ndarray, features: np.ndarray, starts: np.ndarray, future: Future, **fields: Any
) -> Database:
    """The database, with mean and deviation over the frames of all sequences."""
    inside = np.zeros(len(keypoints), bool)
    inside[starts[:, None] + np.arange(SEQUENCE)] = True
    statistics: dict[str, Any] = {}
    for name, array in (("keypoint", keypoints), ("feature", features)):
        mean, deviation = _mean_and_deviation(array, inside)
        # A number that never changes, but for its rounding, keeps its unit.
        deviation[deviation < _CONSTANT] = 1.0
        statistics |= {f"{name}_mean": mean, f"{name}_deviation": deviation}
    if future == "zeros":
        features[~inside] = statistics["feature_mean"]
    return Database(keypoints=keypoints, features=features, starts=starts, **statistics, **fields)


def _mean_and_deviation(array: np.ndarray, inside: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of the frames (n, ...) that are inside (n,), a block at a time: as float64, all are a lot of memory."""
    blocks = [slice(begin, begin + _BLOCK) for begin in range(0, len(array), _BLOCK)]
    mean = sum(array[block][inside[block]].sum(axis=0, dtype=np.float64) for block in blocks) / inside.sum()
    squares = (((array[block][inside[block]] - mean) ** 2).sum(axis=0) for block in blocks)
    return mean, np.sqrt(sum(squares) / inside.sum())


def _check(recording: Recording) -> None:
    frames = len(recording.keypoints)
    if frames == 0 or recording.keypoints.shape[1:] != (len(KEYPOINTS), 3):
        wanted = f"(1 or more, {len(KEYPOINTS)}, 3)"
        raise InvalidValueError(f"keypoints of {recording.name}", recording.keypoints.shape, [wanted])
    if recording.features.shape[1:] != (FEATURES,) or len(recording.features) < frames:
        wanted = f"({frames} or more, {FEATURES})"
        raise InvalidValueError(f"features of {recording.name}", recording.features.shape, [wanted])
    for array in (recording.keypoints, recording.features):
        if not np.isfinite(array).all():
            raise InvalidValueError(f"{recording.name} holds numbers that are not finite")
    for kind in recording.labels:
        if kind not in LABELS:
            raise InvalidValueError(f"kind of label of {recording.name}", kind, LABELS)
