"""Loudness: a gain, and normalisation that never looks ahead: a stream and a file give the same signal."""

import numpy as np

BLOCK = 160
"""Samples that share one gain (10 ms)."""

SPEECH_LEVEL = -26.0
"""Level that speech is brought to, and is taken to have before any was heard [dB of full scale]."""

GATE = -70.0
"""Blocks below this level are silence and leave the gain as it is [dB of full scale]."""

KNEE = 0.8
"""Amplitude up to which `amplified` is linear, full scale 1."""

_OVER_NOISE = 10.0  # a block counts as speech when it is this far over the noise floor [dB]
_UNDER_PEAK = 20.0  # and no more than this under the recent peak [dB]
_NOISE_RISE = 0.05  # the noise floor falls at once with the signal and rises this fast [dB per block]
_PEAK_FALL = 0.02  # the peak rises at once with the signal and falls this fast [dB per block]
_PRIOR = 10  # SPEECH_LEVEL weighs as much as this many blocks of speech (0.1 s)
_MEMORY = 3000  # speech over which the level is averaged [blocks] (30 s): loud and soft passages stay apart
_SILENCE = -100.0  # level of digital silence [dB of full scale]


class LoudnessNormaliser:
    """Brings the level of speech to SPEECH_LEVEL as the signal arrives.

    The level of speech is the running mean of the levels of its blocks [dB]. Blocks close to the noise floor
    or far under the recent peak are no speech; they get the gain of the speech before them.
    """

    def __init__(self) -> None:
        self._rest = np.zeros(0)
        self._noise = np.inf
        self._peak = -np.inf
        self._level = SPEECH_LEVEL
        self._weight = _PRIOR

    def begin(self) -> None:
        """Begin another signal of the same speaker; samples left over are dropped."""
        self._rest = np.zeros(0)

    def push(self, samples: np.ndarray) -> np.ndarray:
        """Normalise the blocks that are complete; samples left over wait for the next call.

        Args:
            samples: (n,) mono samples at audio.SAMPLE_RATE.

        Returns:
            (m,) float64 samples, m a multiple of BLOCK.
        """
        samples = np.concatenate([self._rest, samples])
        whole = len(samples) - len(samples) % BLOCK
        self._rest = samples[whole:]
        blocks = samples[:whole].reshape(-1, BLOCK)
        levels = decibels(np.mean(blocks**2, axis=1), _SILENCE)
        gains = np.array([self._gain(level) for level in levels])
        return (blocks * gains[:, None]).ravel()

    def _gain(self, level: float) -> float:
        """Take in the level of the next block; the factor for its samples."""
        if level > GATE:
            self._noise = min(self._noise + _NOISE_RISE, level)
            self._peak = max(self._peak - _PEAK_FALL, level)
        if level > max(GATE, self._noise + _OVER_NOISE, self._peak - _UNDER_PEAK):
            self._weight = min(self._weight + 1, _MEMORY)
            self._level += (level - self._level) / self._weight
        return 10 ** ((SPEECH_LEVEL - self._level) / 20)


def decibels(power: np.ndarray, floor: float) -> np.ndarray:
    """Power in dB, at least `floor` [dB]."""
    return 10 * np.log10(np.maximum(power, 10 ** (floor / 10)))


def amplified(samples: np.ndarray, factor: float) -> np.ndarray:
    """Samples times a factor; peaks over KNEE bend softly, so that none passes full scale."""
    samples = samples * np.float32(factor)
    over = np.maximum(np.abs(samples) - KNEE, 0) / (1 - KNEE)
    bent = KNEE + (1 - KNEE) * np.tanh(over)
    return np.where(over > 0, np.copysign(bent, samples), samples).astype(np.float32)
