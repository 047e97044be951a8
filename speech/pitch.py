"""Another pitch for hibari's voice, with its formants where they are."""

import numpy as np
from hibari import dsp

UNVOICED = 40.0
"""hibari's dsp makes no pulses where f0 is no higher [Hz]."""

_BIN = dsp.SR / dsp.N_FFT


def repitched(
    magnitude: np.ndarray, phase: np.ndarray, f0: np.ndarray, pitch: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The harmonic branch of hibari's spectrum at `pitch` times its f0.

    The model means its spectrum at the harmonics of f0 alone; between them it is arbitrary. So the envelope
    over frequency is interpolated from there, as in sinusoidal modelling (Quatieri & McAulay 1992), and the
    new harmonics take their amplitudes and phases from it. Unvoiced frames stay.

    Args:
        magnitude: (bins, frames) logarithm of the harmonics' magnitude.
        phase: (bins, frames) their phase, as the inverse hyperbolic tangent of its part of pi.
        f0: (frames,) [Hz].
        pitch: Factor of f0.
    """
    voiced = f0 > UNVOICED
    spacing = f0[voiced] / _BIN
    highest = np.floor((len(magnitude) - 1) / spacing)
    place = np.arange(len(magnitude), dtype=np.float32)[:, None] / spacing
    below = np.clip(np.floor(place), 1, highest)
    share = np.clip(place - below, 0, 1)
    low = np.rint(below * spacing).astype(np.intp)
    high = np.rint(np.minimum(below + 1, highest) * spacing).astype(np.intp)

    def between_harmonics(values: np.ndarray) -> np.ndarray:
        start = np.take_along_axis(values, low, axis=0)
        return start + share * (np.take_along_axis(values, high, axis=0) - start)

    magnitude, phase = magnitude.copy(), phase.copy()
    # A higher voice has fewer harmonics; each is stronger, so that all together are as strong as before.
    gain = np.float32(np.log(pitch) / 2)
    magnitude[:, voiced] = between_harmonics(magnitude[:, voiced]) + gain
    angle = np.float32(np.pi) * np.tanh(phase[:, voiced])
    angle = np.arctan2(between_harmonics(np.sin(angle)), between_harmonics(np.cos(angle)))
    phase[:, voiced] = np.arctanh(np.clip(angle / np.float32(np.pi), -0.9999, 0.9999))
    return magnitude, phase, np.where(voiced, np.maximum(f0 * np.float32(pitch), UNVOICED + 1), f0)
