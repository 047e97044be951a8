"""Speech features that a data set brings along, put on the scale of ours (speech/features.py).

The robot searches with features of its own. Those of a data set come from another microphone, window, filter
bank and logarithm, and their sound is not there to compute ours from. Each number is therefore shifted and
stretched until, over the speech of its source, it has the mean and the deviation that ours has over speech.

This assumes that coefficient n is the same in both but for shift and scale, which holds for cosine transforms
of log mel energies of about the same band, and that the source holds enough speech to be like other speech.
What makes a voice or a room special is lost. Where there is sound, features computed from it are better.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gesture_bot.base.frames import FRAME_RATE
from gesture_bot.speech.features import COEFFICIENTS, SILENCE_FEATURES, STATIC
from gesture_bot.speech.loudness import decibels

SPEECH_RANGE = 20.0
"""A frame is speech where its level is less than this under that which one frame in a hundred passes [dB]."""

SPEECH_MEAN = np.array([
    -237.0, 55.8, 4.7, 11.7, -3.5, -0.4, -1.4, 1.1, -3.5, -5.1, -3.5, -4.0, -3.3, -28.2,
])  # fmt: skip
SPEECH_DEVIATION = np.array([
    45.9, 36.7, 19.5, 15.8, 12.0, 8.0, 7.8, 7.0, 6.3, 5.5, 4.7, 6.0, 4.7, 7.0,
])  # fmt: skip
"""Mean and deviation of our 13 MFCC and log mean energy [dB] over speech.

Measured on the demo corpus, on the frames whose energy is over -51 dB, 25 dB under the level that speech is
brought to: `loud = features[:, 13] > -51`, then `features[loud, :14].mean(axis=0)` and `.std(axis=0)`.
"""

_SILENCE = SILENCE_FEATURES[:STATIC].astype(np.float64)
_QUIETEST = 1e-12  # mean power of digital silence


@dataclass(frozen=True)
class Sound:
    """The features that come with one recording.

    Attributes:
        mfcc: (n, 13) MFCC 0 to 12. A source without coefficient 0, the mean of the log mel energies, has the
            level in its place.
        power: (n,) mean power of the signal, in any unit.
        rate: Frames a second.
    """

    mfcc: np.ndarray
    power: np.ndarray
    rate: float


def features_like_ours(sounds: Sequence[Sound]) -> list[np.ndarray]:
    """Features of recordings of one source, such as a speaker or a session before one microphone.

    Frames without speech become silence, as silence is in our features: the noise of a room leaves no trace.

    Returns:
        For each recording, (m, 28) float32 features at 15 frames a second; see speech/features.py.
    """
    statics = [_at_our_rate(sound) for sound in sounds]
    everything = np.concatenate(statics)
    least = np.percentile(everything[:, COEFFICIENTS], 99) - SPEECH_RANGE
    speech = everything[everything[:, COEFFICIENTS] > least]
    deviation = speech.std(axis=0)
    stretch = SPEECH_DEVIATION / np.where(deviation > 0, deviation, 1.0)
    features = []
    for static in statics:
        spoken = static[:, COEFFICIENTS, None] > least
        ours = np.where(spoken, SPEECH_MEAN + stretch * (static - speech.mean(axis=0)), _SILENCE)
        features.append(np.hstack([ours, np.diff(ours, axis=0, prepend=ours[:1])]).astype(np.float32))
    return features


def _at_our_rate(sound: Sound) -> np.ndarray:
    """(m, 14) MFCC and level [dB], each the mean over the time of one of our frames."""
    ends = np.arange(len(sound.power) + 1) / sound.rate
    frames = max(1, int(ends[-1] * FRAME_RATE + 1e-6))
    edges = np.arange(frames + 1) / FRAME_RATE
    sums = np.cumsum(np.column_stack([sound.mfcc, sound.power]), axis=0) / sound.rate
    sums = np.vstack([np.zeros(STATIC), sums])
    means = np.column_stack([np.diff(np.interp(edges, ends, column)) for column in sums.T]) * FRAME_RATE
    means[:, COEFFICIENTS] = decibels(means[:, COEFFICIENTS], 10 * np.log10(_QUIETEST))
    return means
