"""Another speed and pitch for hibari's voice, by way of the spectrum that its model puts out.

The model has a speed of its own, but rounds each phoneme to whole frames: asked for 1.2 times as fast, it is
1.09 times, asked for 1.35, 1.49 times.
"""

from collections.abc import Sequence

import numpy as np
from hibari import dsp

UNVOICED = 40.0
"""hibari's dsp makes no pulses where f0 is no higher [Hz]."""

_BIN = dsp.SR / dsp.N_FFT


def stretched(spectrum: Sequence[np.ndarray], speed: float) -> list[np.ndarray]:
    """The spectrum with `speed` times fewer frames.

    Args:
        spectrum: As dsp.synth takes it: logarithm of the harmonics' magnitude, their phase, logarithms of
            the noise's and the rest's magnitude, phase of the rest, each (bins, frames), and f0 (frames,).
        speed: 2 leaves half of the frames.
    """
    frames = len(spectrum[-1])
    count = max(1, round(frames / speed))
    place = np.clip((np.arange(count, dtype=np.float32) + 0.5) * frames / count - 0.5, 0, frames - 1)
    nearest, below = np.rint(place).astype(int), place.astype(int)
    above, share = np.minimum(below + 1, frames - 1), place - below

    def between(values: np.ndarray) -> np.ndarray:
        return values[..., below] + share * (values[..., above] - values[..., below])

    harmonics, phase, noise, rest, rest_phase, f0 = spectrum
    voiced = (f0[below] > UNVOICED) & (f0[above] > UNVOICED)
    return [
        *(between(harmonics), phase[:, nearest], between(noise), between(rest), rest_phase[:, nearest]),
        np.where(voiced, between(f0), f0[nearest]),
    ]


def repitched(spectrum: Sequence[np.ndarray], pitch: float) -> list[np.ndarray]:
    """The spectrum with its harmonics at `pitch` times their frequencies, and the formants where they are.

    The model means its spectrum at the harmonics of f0 alone; between them it is arbitrary. So the envelope
    over frequency is interpolated from there, as in sinusoidal modelling (Quatieri & McAulay 1992), and the
    new harmonics take their amplitudes from it, and the phase of the nearest old one. Unvoiced frames stay.

    Args:
        spectrum: As in `stretched`.
        pitch: Factor of f0.
    """
    magnitude, phase, *noise, f0 = spectrum
    voiced = f0 > UNVOICED
    spacing = f0[voiced] / _BIN
    highest = np.floor((len(magnitude) - 1) / spacing)
    place = np.arange(len(magnitude), dtype=np.float32)[:, None] / spacing
    below = np.clip(np.floor(place), 1, highest)
    share = np.clip(place - below, 0, 1)
    low = np.rint(below * spacing).astype(np.intp)
    high = np.rint(np.minimum(below + 1, highest) * spacing).astype(np.intp)
    magnitudes = magnitude[:, voiced]
    start = np.take_along_axis(magnitudes, low, axis=0)
    envelope = start + share * (np.take_along_axis(magnitudes, high, axis=0) - start)
    magnitude, phase = magnitude.copy(), phase.copy()
    # A higher voice has fewer harmonics; each is stronger, so that all together are as strong as before.
    gain = np.float32(np.log(pitch) / 2)
    magnitude[:, voiced] = envelope + gain
    phase[:, voiced] = np.take_along_axis(phase[:, voiced], np.where(share < 0.5, low, high), axis=0)
    f0 = np.where(voiced, np.maximum(f0 * np.float32(pitch), UNVOICED + 1), f0)
    return [magnitude, phase, *noise, f0]
