"""How far the words that alignment finds are from where voices say them.

`make bench-alignment`; the last line is one JSON object.
"""

import json
import time

import numpy as np
from machine import machine

from gesture_bot.evaluate.held_sentences import HELD_SENTENCES
from gesture_bot.speech.alignment import align
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.voice import PLAIN, Manner, load_voice

CASES = {
    "embedded": ("embedded", PLAIN, None),
    "embedded, other manner": ("embedded", Manner(speed=1.3, pitch=0.7, energy=0.5), None),
    "embedded, noise at 10 dB": ("embedded", PLAIN, 10.0),
    "embedded, noise at 5 dB": ("embedded", PLAIN, 5.0),
    "espeak en-gb": ("espeak", PLAIN, None),
    "espeak en-us": ("espeak:en-us", PLAIN, None),
}
"""Voice, manner, and signal to noise [dB]."""


def measure(name: str, manner: Manner, noise: float | None) -> dict[str, float]:
    """Errors of the begins and of the stressed vowels [ms], and processor time per time of sound."""
    voice, generator = load_voice(name), np.random.default_rng(0)
    starts, stresses = [], []
    sound = busy = 0.0
    for text in HELD_SENTENCES:
        utterance = voice.speak(text, manner)
        samples = utterance.samples
        if noise is not None:
            loudness = samples.std() * 10 ** (-noise / 20)
            samples = samples + loudness * generator.standard_normal(len(samples))
        begin = time.process_time()
        words = align(samples, text)
        busy += time.process_time() - begin
        sound += len(samples) / SAMPLE_RATE
        for found, said in zip(words, utterance.words, strict=True):
            starts.append(1e3 * abs(found.start - said.start))
            stresses.append(1e3 * abs(found.stress - said.stress))
    return {
        "words": len(starts),
        "start_ms_median": round(float(np.median(starts))),
        "start_ms_p90": round(float(np.percentile(starts, 90))),
        "stress_ms_median": round(float(np.median(stresses))),
        "stress_ms_p90": round(float(np.percentile(stresses, 90))),
        "cpu_share": round(busy / sound, 3),
    }


def main() -> None:
    """Measure every case, print a line each and the JSON."""
    figures = {}
    for case, (name, manner, noise) in CASES.items():
        figures[case] = measure(name, manner, noise)
        print(f"{case}: {figures[case]}", flush=True)
    print(json.dumps({"bench": "alignment", **figures, "machine": machine()}))


if __name__ == "__main__":
    main()
