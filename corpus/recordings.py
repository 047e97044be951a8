"""From recordings to a database: padding their ends and cutting them into sequences."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.keypoints import KEYPOINTS
from gesture_bot.corpus.database import LOOKAHEAD, SEQUENCE, Database
from gesture_bot.speech.features import FEATURES, SILENCE_FEATURES


@dataclass(frozen=True)
class Recording:
    """One person speaking and gesturing.

    Attributes:
        name: What errors call it.
        keypoints: (n, 17, 3) positions [m], pelvis frame, at 15 frames a second.
        features: (n, 28) speech features of the same frames; see speech/features.py.
        emotion: Label of hri_msgs/Expression.
    """

    name: str
    keypoints: np.ndarray
    features: np.ndarray
    emotion: str


def build_database(recordings: Iterable[Recording], metadata: dict[str, str]) -> Database:
    """Cut recordings into sequences of 64 frames, end to end, the last one ending with its recording.

    After the end of every recording the speaker holds still in silence for LOOKAHEAD frames, and before them
    for as long as a recording that is shorter than a sequence takes to fill one.

    Raises:
        InvalidValueError: A recording is empty or not finite, or its features and keypoints differ in length.
    """
    keypoints, features = [], []
    starts, emotion, number = [], [], []
    emotions: list[str] = []
    begin = 0
    for index, recording in enumerate(recordings):
        _check(recording)
        frames = len(recording.keypoints)
        length = max(frames, SEQUENCE)
        still = length + LOOKAHEAD - frames
        keypoints += [recording.keypoints, np.repeat(recording.keypoints[-1:], still, axis=0)]
        features += [recording.features, np.tile(SILENCE_FEATURES, (still, 1))]
        if recording.emotion not in emotions:
            emotions.append(recording.emotion)
        cuts = [*range(0, length - SEQUENCE, SEQUENCE), length - SEQUENCE]
        starts += [begin + cut for cut in cuts]
        emotion += [emotions.index(recording.emotion)] * len(cuts)
        number += [index] * len(cuts)
        begin += length + LOOKAHEAD
    if not starts:
        raise InvalidValueError("no recording to build a database from")
    return Database(
        keypoints=np.concatenate(keypoints).astype(np.float32),
        features=np.concatenate(features).astype(np.float32),
        starts=np.array(starts, np.int64),
        emotion=np.array(emotion, np.int16),
        recording=np.array(number, np.int32),
        emotions=tuple(emotions),
        metadata=metadata,
    )


def _check(recording: Recording) -> None:
    frames = len(recording.keypoints)
    if frames == 0 or recording.keypoints.shape[1:] != (len(KEYPOINTS), 3):
        wanted = f"(1 or more, {len(KEYPOINTS)}, 3)"
        raise InvalidValueError(f"keypoints of {recording.name}", recording.keypoints.shape, [wanted])
    if recording.features.shape != (frames, FEATURES):
        wanted = f"({frames}, {FEATURES})"
        raise InvalidValueError(f"features of {recording.name}", recording.features.shape, [wanted])
    for array in (recording.keypoints, recording.features):
        if not np.isfinite(array).all():
            raise InvalidValueError(f"{recording.name} holds numbers that are not finite")
