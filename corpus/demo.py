"""The demo corpus: sentences of ours, spoken by the embedded voice, with motion composed for them.

It is composed, not recorded: it makes the package work without a download, and is no measure of how people
gesture.
"""

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import lru_cache, partial
from importlib.metadata import version
from os import cpu_count
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.files import cache_dir
from gesture_bot.corpus.database import Database
from gesture_bot.corpus.recordings import Recording, build_database
from gesture_bot.corpus.sentences import SENTENCES
from gesture_bot.corpus.styles import Style, varied
from gesture_bot.corpus.synthesis import gesture
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.features import speech_features
from gesture_bot.speech.voice import Manner, Voice, Word, load_voice

ROUNDS = 2
"""How often every sentence is said, each time in another recording and another variant of its style."""

TOGETHER = (3, 4, 5)
"""Sentences of one recording, in turn."""

IDLE = 12.0
"""Length of the silent recording of each emotion [s]."""

NUANCE = (-0.05, -0.06, -0.2), (0.05, 0.06, 0.2)
"""How far the sentences of one recording differ in speed, pitch and energy [octaves]: 4 %, 4 % and 1.2 dB."""

UNSTRESSED = frozenset([
    "a", "about", "am", "an", "and", "are", "as", "at", "be", "been", "before", "but", "by", "can",
    "cannot", "could", "did", "do", "does", "for", "from", "get", "had", "has", "have", "he", "her",
    "here", "his", "how", "i", "if", "in", "into", "is", "it", "its", "let", "may", "me", "more", "my",
    "no", "not", "of", "off", "on", "or", "our", "out", "she", "should", "so", "some", "than", "that",
    "the", "their", "them", "then", "there", "these", "they", "this", "to", "told", "up", "us", "was",
    "we", "were", "what", "when", "where", "whether", "which", "who", "will", "with", "would", "you",
    "your",
])  # fmt: skip
"""Words that carry no stroke: mostly function words."""

MADE_BY = (
    "body", "database", "demo", "forms", "gestures", "movement", "recordings", "sentences", "styles",
    "synthesis",
)  # fmt: skip
"""Files of this room that shape the corpus; a change in them builds it anew."""

PROVENANCE = {
    "provenance": "gesture_bot demo corpus: embedded voice, composed motion",
    "licence": "Apache-2.0",
}


def load_database(name: str) -> Database:
    """The database in a file or, named "demo", the demo corpus; see database_path.

    Raises:
        FileFormatError: See Database.load.
        InvalidValueError: See database_path.
    """
    path = database_path(name)
    # The nodes of a process share it, until its file is written anew.
    return _loaded(path, path.stat().st_mtime_ns if path.exists() else 0)


@lru_cache(maxsize=1)
def _loaded(path: Path, written: int) -> Database:
    return Database.load(path)


def database_path(name: str) -> Path:
    """The file of a database, or of the demo corpus, "demo".

    For a network to learn from, there is more of the same speaker, some 20 minutes a round: "shuffled:N" is N
    rounds in which the words of each sentence stand in another order. So it says nothing that the demo corpus
    says.

    Raises:
        InvalidValueError: N is no number of rounds.
    """
    kind, _, rounds = name.partition(":")
    if name == "demo":
        return demo_database()
    if kind != "shuffled" or Path(name).exists():
        return Path(name)
    if not (rounds.isdecimal() and int(rounds)):
        raise InvalidValueError("number of rounds in shuffled:N", rounds, ["1 and more"])
    return _built(f"shuffled-{rounds}", rounds=int(rounds), seed=2, shuffled=True)


def demo_database() -> Path:
    """The demo corpus's file, built on first use.

    Two processes that come first build it twice; each puts the same whole file in place.

    Raises:
        FileFormatError: The file cannot be written.
    """
    return _built("demo", rounds=ROUNDS)


def _built(name: str, **settings: Any) -> Path:
    """The file of a corpus of all sentences; for the settings see demo_corpus."""
    path = cache_dir() / f"{name}-{_fingerprint()}.safetensors"
    if not path.exists():
        demo_corpus(SENTENCES, **settings).save(path)
    return path


def demo_corpus(
    sentences: Mapping[str, Sequence[str]],
    rounds: int = 1,
    workers: int | None = None,
    seed: int = 0,
    shuffled: bool = False,
) -> Database:
    """Speak the sentences of each emotion and gesture to them.

    Args:
        sentences: Sentences by emotion: labels that corpus/styles.py knows.
        rounds: How often each is said.
        workers: Threads, as many as processors by default; the result does not depend on it.
        seed: Of every choice.
        shuffled: Whether the words of a sentence stand in another order each time.
    """
    title = "building the demo corpus"
    performed = demo_performances(sentences, title, rounds, workers, seed, shuffled)
    recordings = (recording for recording, _ in performed)
    settings = {"rounds": rounds, "seed": seed, "shuffled": shuffled}
    return build_database(recordings, {**PROVENANCE, "settings": settings})


def demo_performances(
    sentences: Mapping[str, Sequence[str]],
    title: str,
    rounds: int = 1,
    workers: int | None = None,
    seed: int = 0,
    shuffled: bool = False,
) -> Iterator[tuple[Recording, np.ndarray]]:
    """The recordings of the demo speaker, each with its samples; see demo_corpus.

    Args:
        sentences: Sentences by emotion.
        title: Of the progress bar.
        rounds: How often each is said.
        workers: Threads.
        seed: Of every choice.
        shuffled: See demo_corpus.
    """
    takes = [
        take for emotion, said in sentences.items() for take in _takes(emotion, said, rounds, seed, shuffled)
    ]
    with ThreadPoolExecutor(workers or cpu_count()) as pool:
        performed = pool.map(partial(_record, load_voice("embedded")), takes)
        yield from tqdm(performed, title, len(takes), unit="recording", disable=None)


@dataclass(frozen=True)
class _Take:
    """What one recording is made from."""

    name: str
    emotion: str
    sentences: tuple[str, ...]
    style: Style
    seed: tuple[int, ...]


def _takes(emotion: str, sentences: Sequence[str], rounds: int, seed: int, shuffled: bool) -> list[_Take]:
    """Split an emotion's sentences into recordings, and add a silent one."""
    generator = np.random.default_rng([seed, *emotion.encode()])
    groups: list[tuple[str, ...]] = [()]
    for _ in range(rounds):
        left = list(generator.permutation(sentences))
        if shuffled:
            left = [" ".join(generator.permutation(sentence.split())) for sentence in left]
        while left:
            count = TOGETHER[len(groups) % len(TOGETHER)]
            groups.append(tuple(map(str, left[:count])))
            left = left[count:]
    styles = varied(emotion, len(groups), seed)
    return [
        _Take(f"{emotion} {number}", emotion, group, style, (seed, number, *emotion.encode()))
        for number, (group, style) in enumerate(zip(groups, styles, strict=True))
    ]


def _record(voice: Voice, take: _Take) -> tuple[Recording, np.ndarray]:
    generator = np.random.default_rng(take.seed)
    samples, stresses = _speak(voice, take, generator)
    features = speech_features(samples)
    keypoints = gesture(stresses, len(features), take.style, generator)
    return Recording(take.name, keypoints, features, {"emotion": take.emotion}), samples


def _speak(voice: Voice, take: _Take, generator: np.random.Generator) -> tuple[np.ndarray, list[list[float]]]:
    """Say the sentences with pauses between them: samples, and each sentence's stressed moments [s]."""
    if not take.sentences:
        return _silence(IDLE), []
    said = [_silence(generator.uniform(0.5, 1.0))]
    stresses = []
    for sentence in take.sentences:
        utterance = voice.speak(sentence, take.style.voice.times(_nuance(generator)))
        begin = sum(map(len, said)) / SAMPLE_RATE
        stresses.append([begin + word.stress for word in utterance.words if _carries_stroke(word)])
        said += [utterance.samples, _silence(generator.uniform(0.3, 0.8) / take.style.voice.speed)]
    said.append(_silence(generator.uniform(1.0, 3.0)))
    return np.concatenate(said), stresses


def _nuance(generator: np.random.Generator) -> Manner:
    """How one sentence differs from the next."""
    return Manner(*(float(factor) for factor in 2 ** generator.uniform(*NUANCE)))


def _silence(seconds: float) -> np.ndarray:
    return np.zeros(round(seconds * SAMPLE_RATE), np.float32)


def _carries_stroke(word: Word) -> bool:
    return word.text.lower() not in UNSTRESSED


def _fingerprint() -> str:
    """What the corpus is made from: the code, and the voice."""
    digest = hashlib.blake2b(version("hibari-tts").encode(), digest_size=6)
    rooms = Path(__file__).parents[1]
    here = (rooms / "corpus" / f"{name}.py" for name in MADE_BY)
    for source in (*here, *sorted(rooms.glob("speech/*.py"))):
        digest.update(source.read_bytes())
    return digest.hexdigest()
