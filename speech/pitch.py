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
    magnitude, phase, f0 = magnitude.copy(), phase.copy(), f0.copy()
    bins = np.arange(len(magnitude))
    for frame in np.flatnonzero(f0 > UNVOICED):
        harmonics = np.arange(f0[frame] / _BIN, bins[-1], f0[frame] / _BIN)
        nearest = harmonics.round().astype(int)
        turns = np.exp(1j * np.pi * np.tanh(phase[nearest, frame]))
        # A higher voice has fewer harmonics; each is stronger, so that all together are as strong as before.
        magnitude[:, frame] = np.interp(bins, harmonics, magnitude[nearest, frame]) + np.log(pitch) / 2
        part_of_pi = np.angle(np.interp(bins, harmonics, turns)) / np.pi
        phase[:, frame] = np.arctanh(np.clip(part_of_pi, -0.9999, 0.9999))
        f0[frame] = max(f0[frame] * pitch, UNVOICED + 1)
    return magnitude, phase, f0
