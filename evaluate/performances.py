"""Motion that a database does not hold, with its speech: of the demo speaker, or of recordings."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.corpus.database import Database
from gesture_bot.corpus.demo import demo_performances
from gesture_bot.corpus.importing import file_digest
from gesture_bot.corpus.readers import reader_of
from gesture_bot.corpus.skeletons import SOUNDS, choose_skeleton, load_skeletons
from gesture_bot.corpus.styles import STYLES
from gesture_bot.corpus.takes import motion_of, recordings_of
from gesture_bot.evaluate.held_sentences import HELD_SENTENCES
from gesture_bot.evaluate.pieces import Performance
from gesture_bot.speech.activity import speech_activity
from gesture_bot.speech.audio import load_audio
from gesture_bot.speech.beats import speech_beats
from gesture_bot.speech.features import speech_features

_SEED = 1  # the demo corpus has 0: the held-out styles are others, too


def held_performances(sentences: Sequence[str] = HELD_SENTENCES) -> list[Performance]:
    """Sentences that the demo corpus does not hold, performed by its speaker in every emotion."""
    said = dict.fromkeys(STYLES, sentences)
    return [
        _performance(recording.name, samples, recording.keypoints.astype(np.float64), recording.features)
        for recording, samples in demo_performances(said, "performing held-out sentences", seed=_SEED)
        if samples.any()  # each emotion has a silent recording
    ]


def recorded_performances(paths: Sequence[Path], database: Database) -> list[Performance]:
    """What is in files of recordings; see corpus/readers.py.

    Args:
        paths: Motion, with the sound beside it or speech features in it.
        database: Must not hold them.

    Raises:
        FileFormatError: A file cannot be used.
        InvalidValueError: The database was made from it.
    """
    held = {
        digest for source in database.metadata.get("sources", ()) for digest in source["digests"].values()
    }
    performances: list[Performance] = []
    for path in paths:
        if file_digest(path) in held:
            raise InvalidValueError("the database was built from this recording; leave it out", str(path))
        performances += _read(path)
    return performances


def _read(path: Path) -> Iterator[Performance]:
    skeletons = list(load_skeletons().values())
    sounds = [file for file in path.absolute().parent.iterdir() if file.suffix.lower() in SOUNDS]
    for take in reader_of(path).read(path):
        skeleton = choose_skeleton(take, path.stem, skeletons)
        if take.features is None:
            samples = load_audio(skeleton.sound_file(path, sounds))
            keypoints = motion_of(take, skeleton).keypoints
            yield _performance(take.name, samples, keypoints, speech_features(samples))
            continue
        for recording in recordings_of(take, skeleton, take.features, {})[0]:
            features = recording.features[: len(recording.keypoints)]
            # Who speaks cannot be told from features. MM22 knows no silence: it searches always.
            speech = np.ones(len(features), bool)
            keypoints = recording.keypoints.astype(np.float64)
            yield Performance(recording.name, features, speech, keypoints, None)


def _performance(name: str, samples: np.ndarray, keypoints: np.ndarray, features: np.ndarray) -> Performance:
    frames = min(len(keypoints), len(features))
    speech = speech_activity(samples)[:frames]
    return Performance(name, features[:frames], speech, keypoints[:frames], speech_beats(samples))
