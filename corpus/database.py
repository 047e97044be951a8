"""The database of speech and gesture that the search runs on, and its file."""

import hashlib
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save_file

from gesture_bot.base.errors import FileFormatError, InvalidValueError
from gesture_bot.base.files import write_whole
from gesture_bot.base.frames import FRAME_RATE
from gesture_bot.base.keypoints import KEYPOINTS
from gesture_bot.speech.features import FEATURES

SEQUENCE = 64
"""Frames of a sequence (T_match in MM22)."""

LOOKAHEAD = 14
"""Frames of real future that follow every sequence: the reach of the audio feature (MM22)."""

LABELS = ("emotion", "style", "speaker")
"""Kinds of labels that a sequence may have. Emotions that hri_msgs/Expression knows answer to `emotion`."""

FORMAT = "gesture_bot database"
VERSION = 2

_DTYPES = {
    "keypoints": np.float32,
    "features": np.float32,
    "starts": np.int64,
    "recording": np.int32,
    "labels": np.int16,
    "keypoint_mean": np.float64,
    "keypoint_deviation": np.float64,
    "feature_mean": np.float64,
    "feature_deviation": np.float64,
}


@dataclass(frozen=True)
class Database:
    """Recordings one after another, and the 64-frame sequences cut from them.

    The frames after a sequence are its real future: at least LOOKAHEAD of them belong to its recording.

    Attributes:
        keypoints: (N, 17, 3) float32 positions [m], pelvis frame, at 15 frames a second.
        features: (N, 28) float32 speech features of the same frames; see speech/features.py.
        starts: (S,) int64 frame at which each sequence begins.
        recording: (S,) int32 number of the recording that each sequence was cut from.
        labels: (S, 3) int16 labels of each sequence, in the order of LABELS: an index into the `names` of
            that kind, or -1 where it has none.
        keypoint_mean, keypoint_deviation: (17, 3) statistics of the keypoints for z-scoring [m].
        feature_mean, feature_deviation: (28,) statistics of the features for z-scoring.
        names: The labels of each kind.
        metadata: Where the data comes from, as JSON values: provenance, licence, sources, settings, ...

    Raises:
        InvalidValueError: An array has the wrong shape or type, or an index points outside.
    """

    keypoints: np.ndarray
    features: np.ndarray
    starts: np.ndarray
    recording: np.ndarray
    labels: np.ndarray
    keypoint_mean: np.ndarray
    keypoint_deviation: np.ndarray
    feature_mean: np.ndarray
    feature_deviation: np.ndarray
    names: dict[str, tuple[str, ...]]
    metadata: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        frames, sequences = len(self.keypoints), len(self.starts)
        shapes = {
            "keypoints": (frames, len(KEYPOINTS), 3),
            "features": (frames, FEATURES),
            "starts": (sequences,),
            "recording": (sequences,),
            "labels": (sequences, len(LABELS)),
            "keypoint_mean": (len(KEYPOINTS), 3),
            "keypoint_deviation": (len(KEYPOINTS), 3),
            "feature_mean": (FEATURES,),
            "feature_deviation": (FEATURES,),
        }
        for name, array in self._arrays().items():
            if array.shape != shapes[name] or array.dtype != _DTYPES[name]:
                wanted = f"{_DTYPES[name].__name__} {shapes[name]}"
                raise InvalidValueError(f"{name} of a database", f"{array.dtype} {array.shape}", [wanted])
        if sequences == 0:
            raise InvalidValueError("a database without a sequence")
        last = frames - SEQUENCE - LOOKAHEAD
        if self.starts.min() < 0 or self.starts.max() > last:
            outside = int(self.starts[(self.starts < 0) | (self.starts > last)][0])
            raise InvalidValueError("start of a sequence", outside, [f"0 to {last}"])
        for kind, indices in zip(LABELS, self.labels.T, strict=True):
            names = self.names[kind]
            if indices.min() < -1 or indices.max() >= len(names):
                raise InvalidValueError(f"index of a label outside the names of {kind}", valid=names)

    def labelled(self, kind: str, name: str) -> np.ndarray:
        """(S,) bool: the sequences with a label.

        Args:
            kind: One of LABELS.
            name: One of the `names` of that kind.

        Raises:
            InvalidValueError: The kind or the name is not there.
        """
        if kind not in LABELS:
            raise InvalidValueError("unknown kind of label", kind, LABELS)
        if not self.names[kind]:
            raise InvalidValueError(f"the database has no labels for {kind}; asked for", name)
        if name not in self.names[kind]:
            raise InvalidValueError(f"no sequence of the database has this {kind}", name, self.names[kind])
        return self.labels[:, LABELS.index(kind)] == self.names[kind].index(name)

    def label(self, sequence: int, kind: str) -> str:
        """The label of a sequence, or an empty string where it has none of this kind."""
        index = int(self.labels[sequence, LABELS.index(kind)])
        return self.names[kind][index] if index >= 0 else ""

    def _arrays(self) -> dict[str, np.ndarray]:
        return {name: getattr(self, name) for name in _DTYPES}

    def save(self, path: Path) -> None:
        """Write the database as a safetensors file, whole or not at all.

        Raises:
            FileFormatError: The file cannot be written.
        """
        arrays = {name: np.ascontiguousarray(array) for name, array in self._arrays().items()}
        header: dict[str, Any] = {
            "version": VERSION,
            "frame_rate": FRAME_RATE,
            "skeleton": list(KEYPOINTS),
            "names": self.names,
            "metadata": self.metadata,
        }
        header["checksum"] = _checksum(arrays, header)
        # One entry alone: safetensors writes several in an order that changes from run to run.
        entry = {FORMAT: json.dumps(header, sort_keys=True)}
        try:
            with write_whole(path) as temporary:
                save_file(arrays, temporary, entry)
        except SafetensorError as error:
            raise FileFormatError(f"cannot write {path} ({error})") from error

    @classmethod
    def load(cls, path: Path) -> Self:
        """Map a database file into memory: its arrays are read-only views of the file.

        Raises:
            FileFormatError: The file is missing, truncated or changed, is no database, was written by another
                version, or holds another skeleton or frame rate.
        """
        if path.is_dir():
            raise FileFormatError(f"cannot read {path} as a database (it is a folder)")
        try:
            # safetensors checks the header against the file's size; its numpy arrays would be copies.
            with safe_open(path, framework="numpy") as opened:
                entry = (opened.metadata() or {}).get(FORMAT)
        except (OSError, SafetensorError) as error:
            raise FileFormatError(f"cannot read {path} as a database ({error})") from error
        if entry is None:
            raise FileFormatError(f"{path} is a safetensors file, but no {FORMAT}")
        damaged = FileFormatError(f"{path} is damaged: its content does not match its checksum")
        try:
            header = json.loads(entry)
            for key, valid in ("version", VERSION), ("frame_rate", FRAME_RATE), ("skeleton", list(KEYPOINTS)):
                if header[key] != valid:
                    again = "; build it again" if key == "version" else ""
                    raise FileFormatError(f"{path}: {key} of the database{again}", header[key], [valid])
            arrays = _map_arrays(path)
            checksum = header.pop("checksum")
        except (KeyError, ValueError) as error:
            raise damaged from error
        if checksum != _checksum(arrays, header):
            raise damaged
        names = {kind: tuple(header["names"][kind]) for kind in LABELS}
        return cls(**arrays, names=names, metadata=header["metadata"])


def _map_arrays(path: Path) -> dict[str, np.ndarray]:
    """The arrays of a safetensors file as views of the mapped file."""
    data = np.memmap(path, mode="r").view(np.ndarray)
    header_end = 8 + int(data[:8].view("<u8")[0])
    entries: dict[str, Any] = json.loads(data[8:header_end].tobytes())
    arrays = {}
    for name, dtype in _DTYPES.items():
        begin, end = (header_end + offset for offset in entries[name]["data_offsets"])
        arrays[name] = data[begin:end].view(dtype).reshape(entries[name]["shape"])
    return arrays


def _checksum(arrays: dict[str, np.ndarray], header: dict[str, Any]) -> str:
    digest = hashlib.blake2b(json.dumps(header, sort_keys=True).encode(), digest_size=16)
    for name in _DTYPES:
        digest.update(name.encode())
        digest.update(arrays[name].data)
    return digest.hexdigest()
