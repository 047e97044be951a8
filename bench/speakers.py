"""Whether another voice than the database's moves the robot as richly, and its loud passages stay loud.

`make bench-speakers`, or `python bench/speakers.py FILE...` with a sound file of each other speaker; without
one, the other speaker is the embedded voice at four fifths of its pitch. The last line is one JSON object.
"""

import json
import sys
from pathlib import Path
from unittest.mock import patch

import numpy as np
import soxr
from machine import machine

from gesture_bot.base.frames import FRAME_RATE
from gesture_bot.corpus.database import Database
from gesture_bot.corpus.demo import load_database
from gesture_bot.evaluate.held_sentences import HELD_SENTENCES
from gesture_bot.matching.emotions import NEUTRAL
from gesture_bot.matching.selector import Selector
from gesture_bot.matching.speaker import Speaker, speech_statistics
from gesture_bot.refine.offline import refined_windows
from gesture_bot.speech.activity import speech_activity
from gesture_bot.speech.audio import SAMPLE_RATE, load_audio
from gesture_bot.speech.features import COEFFICIENTS, speech_features
from gesture_bot.speech.streaming import speech_frames
from gesture_bot.speech.voice import load_voice

LENGTH = 600 * SAMPLE_RATE
"""Speech that windows are chosen for (10 minutes); shorter speech is repeated."""

PASSAGE = 5 * SAMPLE_RATE
"""Loud and soft passages take turns."""

LOUDER = 6.0
"""So much are they louder and softer than the speech [dB]."""


def chosen(database: Database, samples: np.ndarray, normalised: bool) -> tuple[float, float]:
    """How widely the windows spread over the database's sequences [bit], and their audio distance."""
    heard = np.resize(samples, LENGTH)
    speech = speech_frames(heard)
    selector = Selector(database, {}, NEUTRAL)
    push = Speaker.push if normalised else lambda self, features, speech: features
    with patch.object(Speaker, "push", push):
        windows = [window for window, _ in refined_windows(selector, speech, range(len(speech)))]
    spoken = [window for window in windows if window.source == "speech"]
    shares = np.unique([window.sequence for window in spoken], return_counts=True)[1] / len(spoken)
    distance = np.mean([window.audio_distance for window in spoken])
    return -float((shares * np.log2(shares)).sum()), float(distance)


def loudness_kept(database: Database, samples: np.ndarray) -> float:
    """Difference between loud and soft passages in the query, as a share of that in the sound."""
    heard = np.resize(samples, LENGTH // 10)
    louder = np.where(np.arange(len(heard)) // PASSAGE % 2, -LOUDER, LOUDER)
    features, speech = speech_features(heard * 10 ** (louder / 20)), speech_activity(heard)
    speaker = Speaker(*speech_statistics(database))
    energy = np.array([speaker.push(*frame)[COEFFICIENTS] for frame in zip(features, speech, strict=True)])
    plain = speech_features(heard)[:, COEFFICIENTS]
    loud = louder[np.arange(len(energy)) * SAMPLE_RATE // FRAME_RATE] > 0
    since = np.arange(len(energy)) > 10 * FRAME_RATE  # the speaker is known by then
    apart, apart_before = (
        values[speech & loud & since].mean() - values[speech & ~loud & since].mean()
        for values in (energy, plain)
    )
    return float((apart - apart_before) / (2 * LOUDER))


def main() -> None:
    database = load_database("demo")
    voice = load_voice("embedded")
    own = np.concatenate([voice.speak(sentence).samples for sentence in HELD_SENTENCES])
    others = {Path(file).stem: load_audio(file) for file in sys.argv[1:]}
    others = others or {"embedded, deeper": soxr.resample(own, 4, 5)}
    figures = {}
    for name, samples in {"embedded": own, **others}.items():
        # Beside as much speech of the database's voice, which is repeated as often.
        reference, _ = chosen(database, own[: len(samples)], normalised=True)
        spread, distance = chosen(database, samples, normalised=True)
        plain_spread, plain_distance = chosen(database, samples, normalised=False)
        figures[name] = {
            "entropy_share_of_own_voice": round(spread / reference, 3),
            "entropy_bit": round(spread, 2),
            "entropy_plain_bit": round(plain_spread, 2),
            "audio_distance": round(distance, 3),
            "audio_distance_plain": round(plain_distance, 3),
            "loudness_kept": round(loudness_kept(database, samples), 2),
        }
        print(f"{name}: {figures[name]}", flush=True)
    print(json.dumps({"bench": "speakers", **figures, "machine": machine()}))


if __name__ == "__main__":
    main()
