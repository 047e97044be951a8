"""Importing one file: what came out of it is kept in a file of its own until the database is whole."""

import hashlib
import json
from collections import Counter
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from gesture_bot.base.errors import FileFormatError, GestureBotError
from gesture_bot.base.files import write_whole
from gesture_bot.corpus.readers import reader_of
from gesture_bot.corpus.recordings import Recording
from gesture_bot.corpus.skeletons import SkeletonMap, choose_skeleton
from gesture_bot.corpus.takes import CUT, recordings_of
from gesture_bot.speech.audio import load_audio
from gesture_bot.speech.features import COEFFICIENTS, FLOOR, speech_features


@dataclass(frozen=True)
class Job:
    """A file to import.

    Attributes:
        path: The file.
        name: What the database calls it.
        sounds: The sound files that may belong to it.
        skeletons: The skeleton maps to choose from.
        part: Where to keep what comes out of it.
    """

    path: Path
    name: str
    sounds: tuple[Path, ...]
    skeletons: tuple[SkeletonMap, ...]
    part: Path


@dataclass(frozen=True)
class Source:
    """Where recordings come from.

    Attributes:
        name: Of the file.
        skeleton: The map that it was read with.
        digests: BLAKE2b of each file that was read, by its path.
        frames: Counts of the source's frames; see takes.recordings_of.
    """

    name: str
    skeleton: str
    digests: dict[str, str]
    frames: dict[str, int]


def import_file(job: Job) -> str:
    """Import a file, unless its part is there and fresh.

    Returns:
        One line on why the file is left out; empty when all went well.

    Raises:
        FileFormatError: The part cannot be written.
    """
    try:
        if _is_fresh(job.part):
            return ""
        recordings, source = _import(job)
    except GestureBotError as error:
        return str(error) if str(job.path) in str(error) else f"{job.path}: {error}"
    except Exception as error:  # no file, however odd, stops the hours of work on the others
        return f"{job.path} cannot be imported ({type(error).__name__}: {' '.join(str(error).split())})"
    _save(job.part, recordings, source)
    return ""


def load_recordings(part: Path) -> list[Recording]:
    """What came out of a file.

    Raises:
        FileFormatError: Its part is gone.
    """
    with _opened(part) as kept:
        about = json.loads(str(kept["about"]))
        keypoints = np.split(kept["keypoints"], about["keypoint_cuts"])
        features = np.split(kept["features"], about["feature_cuts"])
    named = zip(about["names"], keypoints, features, about["labels"], strict=True)
    return [Recording(*one) for one in named]


def load_source(part: Path) -> Source:
    """Where it comes from.

    Raises:
        FileFormatError: Its part is gone.
    """
    with _opened(part) as kept:
        return Source(**json.loads(str(kept["about"]))["source"])


def _opened(part: Path) -> np.lib.npyio.NpzFile:
    try:
        return np.load(part)
    except FileNotFoundError as error:
        raise FileFormatError(
            f"{part} has been taken away; does another build-database write the same file?"
        ) from error


def _import(job: Job) -> tuple[list[Recording], Source]:
    """Of several takes, those that cannot be used are counted; if none can, it is the first that is told."""
    recordings: list[Recording] = []
    frames: Counter[str] = Counter()
    digests = {str(job.path): file_digest(job.path)}
    problem = ""
    for take in reader_of(job.path).read(job.path):
        try:
            skeleton = choose_skeleton(take, job.path.stem, job.skeletons)
            features = take.features
            if features is None:
                sound = skeleton.sound_file(job.path, job.sounds)
                digests[str(sound)] = file_digest(sound)
                features = speech_features(load_audio(sound))
                if (features[:, COEFFICIENTS] <= FLOOR).all():
                    raise FileFormatError(f"{sound} is silent from beginning to end")
            labels = {**skeleton.labels(job.path.stem), **take.labels}
            made, counts = recordings_of(take, skeleton, features, labels)
        except FileFormatError as error:
            problem = problem or str(error)
            frames += Counter(read=len(take.positions), unusable=len(take.positions))
        else:
            recordings += made
            frames += counts
    if not recordings:
        raise FileFormatError(problem or f"nothing of it can be used ({described(frames)})")
    return recordings, Source(job.name, skeleton.name, digests, dict(frames))


def described(frames: Counter[str]) -> str:
    """Counts of frames in words."""
    cut = [f"{frames[why]} {why}" for why in CUT if frames[why]]
    return (
        f"{frames['read']} frames read, {frames['mended']} mended, {frames['kept']} kept; "
        f"cut: {', '.join(cut) or 'none'}"
    )


def _is_fresh(part: Path) -> bool:
    """Whether a part exists, and the files that it was made from are what they were."""
    if not part.exists():
        return False
    digests = load_source(part).digests.items()
    return all(Path(path).exists() and file_digest(Path(path)) == digest for path, digest in digests)


def _save(part: Path, recordings: list[Recording], source: Source) -> None:
    keypoints = [recording.keypoints for recording in recordings]
    features = [recording.features for recording in recordings]
    about = {
        "names": [recording.name for recording in recordings],
        "labels": [dict(recording.labels) for recording in recordings],
        "keypoint_cuts": np.cumsum([len(array) for array in keypoints[:-1]], dtype=int).tolist(),
        "feature_cuts": np.cumsum([len(array) for array in features[:-1]], dtype=int).tolist(),
        "source": asdict(source),
    }
    with write_whole(part) as temporary:
        np.savez(
            temporary,
            about=np.array(json.dumps(about)),
            keypoints=np.concatenate(keypoints),
            features=np.concatenate(features),
        )


def file_digest(path: Path) -> str:
    """BLAKE2b of a file, by which a Source knows it.

    Raises:
        FileFormatError: It cannot be read.
    """
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, lambda: hashlib.blake2b(digest_size=16)).hexdigest()
    except OSError as error:
        raise FileFormatError(f"cannot read {path} ({error.strerror})") from error
