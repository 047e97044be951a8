"""How well words of the semantic banks are heard in speech, beside pocketsphinx's own keyphrase mode.

`make bench-keywords`; the last line is one JSON object. Sentences of bench/keyword_sentences.py, spoken
by voices from wheels in turn, are one stream a voice, as from a microphone, in pieces of 100 ms. The
keywords of a text are what speech/keywords.py finds in its words, timed by pocketsphinx's alignment of
text and clean sound. One is heard where a trigger of the same gesture is found in the words that are
recognised and overlaps it, give or take 0.2 s.

Latency is counted from the end of the keyword's last word in the sound to the moment at which the piece
has arrived in which that word becomes sure, plus the time that decoding a piece takes on average. What
the spotter waits, where a phrase may go on, comes on top.

Nothing was tuned on these sentences: settings were chosen on those of the demo corpus. espeak, whose
formants sound like no person, is told apart and not counted in the rest.
"""

import json
import re
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pocketsphinx
import psutil
from keyword_sentences import KEYWORD_SENTENCES, PLAIN_SENTENCES
from machine import machine
from tqdm import tqdm
from voices import speak

from gesture_bot.matching.banks import load_banks, triggers
from gesture_bot.nodes.keyword_spotter import RECOGNISED_PATIENCE
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.keywords import KeywordSpotter, Spotted
from gesture_bot.speech.recogniser import Recogniser
from gesture_bot.speech.recogniser_process import RecogniserProcess
from gesture_bot.speech.voice import Word

PIECE = SAMPLE_RATE // 10
GAP = 0.7
"""Between two sentences [s]."""

TOLERANCE = 0.2
COUNTED = ("hibari", "joe", "pico")
APART = "espeak"
SHARE = 3
"""Every voice says one of so many sentences, in turn; in noise, a third of those."""

NOISES = (20, 10, 5)
KEYPHRASE_THRESHOLD = 1e4
"""Of the rival, a sound of a phrase: of 1e-4 to 1e4 the best F1 on the sentences of the demo corpus."""

Heard = list[tuple[Spotted, float]]


@dataclass
class Score:
    """Counts that add up."""

    said: int
    found: int
    hits: int
    latencies: list[float]
    sound: float
    cpu: float

    def __add__(self, other: "Score") -> "Score":
        return Score(
            self.said + other.said,
            self.found + other.found,
            self.hits + other.hits,
            self.latencies + other.latencies,
            self.sound + other.sound,
            self.cpu + other.cpu,
        )

    def told(self) -> dict[str, float]:
        """Its measures."""
        latencies = np.array(self.latencies or [0.0]) * 1e3
        return {
            "precision": round(self.hits / max(1, self.found), 3),
            "recall": round(self.hits / max(1, self.said), 3),
            "latency_ms_median": round(float(np.median(latencies))),
            "latency_ms_p90": round(float(np.quantile(latencies, 0.9))),
            "cpu_share": round(self.cpu / self.sound, 3),
            "keywords": self.said,
        }


def words(text: str) -> list[str]:
    return re.findall(r"[a-z']+", text.lower())


def aligned(decoder: pocketsphinx.Decoder, sound: np.ndarray, text: str) -> list[Word]:
    """The words of a sentence with their times in its clean sound."""
    decoder.set_align_text(" ".join(words(text)))
    decoder.start_utt()
    decoder.process_raw((sound * 32767).astype(np.int16).tobytes(), full_utt=True)
    decoder.end_utt()
    timed = [
        Word(re.sub(r"\(\d+\)", "", one.word), one.start_frame / 100, (one.end_frame + 1) / 100, 0.0)
        for one in decoder.seg() or ()
        if one.word[0] not in "<["
    ]
    # Nothing where the aligner is lost, as it is now and then with espeak.
    return timed if [word.text for word in timed] == words(text) else []


def stream(voice: str, sentences: Sequence[str]) -> tuple[np.ndarray, list[Spotted]]:
    """Sentences one after the other, and the keywords in them."""
    decoder = pocketsphinx.Decoder(
        samprate=SAMPLE_RATE,
        loglevel="FATAL",
        lm=None,
        bestpath=False,
        beam=1e-120,
        pbeam=1e-120,
        wbeam=1e-100,
    )
    said, parts, now = [], [], 0.0
    for sentence in sentences:
        sound = speak(voice, sentence)
        spotter = KeywordSpotter(triggers(load_banks()))
        if not (words_in := aligned(decoder, sound, sentence)):
            continue
        now += GAP
        timed = [Word(w.text, now + w.start, now + w.end, 0.0) for w in words_in]
        said += spotter.spot(timed) + spotter.flush()
        parts += [np.zeros(round(GAP * SAMPLE_RATE), np.float32), sound]
        now = sum(map(len, parts)) / SAMPLE_RATE
    sound = np.concatenate([*parts, np.zeros(SAMPLE_RATE, np.float32)])
    return sound + 1e-4 * np.random.default_rng(0).standard_normal(len(sound)).astype(np.float32), said


def noisy(sound: np.ndarray, ratio: float) -> np.ndarray:
    """Pink noise so many decibels below the speech, pauses left out."""
    spectrum = np.fft.rfft(np.random.default_rng(1).standard_normal(len(sound)))
    spectrum[1:] /= np.sqrt(np.arange(1, len(spectrum)))
    noise = np.fft.irfft(spectrum, len(sound))
    loud = np.abs(sound) > 1e-3
    noise *= np.sqrt(np.mean(sound[loud] ** 2)) * 10 ** (-ratio / 20) / noise.std()
    return np.clip(sound + noise, -1, 1).astype(np.float32)


def recognised(sound: np.ndarray) -> tuple[Heard, float]:
    """What ours hears, with the moment at which it does, and the processor's time."""
    recogniser = Recogniser(triggers(load_banks()))
    spotter = KeywordSpotter(triggers(load_banks()))
    heard: Heard = []
    last, sure, begin = 0.0, {}, time.process_time()
    for first in range(0, len(sound), PIECE):
        arrived = (first + PIECE) / SAMPLE_RATE
        found = recogniser.push(sound[first : first + PIECE], first / SAMPLE_RATE)
        if not found and arrived - last > RECOGNISED_PATIENCE:
            heard += [(spotted, 0.0) for spotted in spotter.flush()]
        for word in found:
            last = sure[word.end] = arrived
            heard += [(one, 0.0) for one in spotter.spot([Word(word.text, word.start, word.end, 0.0)])]
    heard += [(spotted, 0.0) for spotted in spotter.flush()]
    taken = time.process_time() - begin
    decoding = taken / len(sound) * PIECE
    return [(spotted, sure[spotted.end] + decoding) for spotted, _ in heard], taken


def keyphrases(sound: np.ndarray) -> tuple[Heard, float]:
    """What pocketsphinx's keyphrase mode hears."""
    banks = triggers(load_banks())
    decoder = pocketsphinx.Decoder(samprate=SAMPLE_RATE, loglevel="FATAL", lm=None)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "phrases"
        lines = []
        for phrase in banks:
            sounds = sum(len(decoder.lookup_word(word).split()) for word in phrase.split())
            lines.append(f"{phrase} /{KEYPHRASE_THRESHOLD**sounds:g}/")
        path.write_text("\n".join(lines) + "\n")
        decoder.add_kws("phrases", str(path))
    decoder.activate_search("phrases")
    heard: Heard = []
    utterance, begin = 0.0, time.process_time()
    decoder.start_utt()
    for first in range(0, len(sound), PIECE):
        decoder.process_raw((sound[first : first + PIECE] * 32767).astype(np.int16).tobytes())
        arrived = (first + PIECE) / SAMPLE_RATE
        if decoder.hyp():
            for one in decoder.seg():
                phrase = one.word.strip()
                start, end = utterance + one.start_frame / 100, utterance + one.end_frame / 100
                heard.append((Spotted(banks[phrase], phrase, start, end, start), arrived))
            decoder.end_utt()
            decoder.start_utt()
            utterance = arrived
    decoder.end_utt()
    taken = time.process_time() - begin
    return [(spotted, moment + taken / len(sound) * PIECE) for spotted, moment in heard], taken


def score(said: Sequence[Spotted], heard: Heard, sound: np.ndarray, cpu: float) -> Score:
    """Count what was heard of what was said."""
    left, latencies = list(said), []
    for spotted, moment in heard:
        for one in left:
            overlaps = spotted.start < one.end + TOLERANCE and spotted.end > one.start - TOLERANCE
            if one.gesture == spotted.gesture and overlaps:
                latencies.append(moment - one.end)
                left.remove(one)
                break
    return Score(len(said), len(heard), len(latencies), latencies, len(sound) / SAMPLE_RATE, cpu)


Listener = Callable[[np.ndarray], tuple[Heard, float]]


def measure(voice: str, offset: int) -> dict[str, Score]:
    """Everything that one voice says."""
    mine = KEYWORD_SENTENCES[offset % SHARE :: SHARE]
    clean, said = stream(voice, mine)
    result = {"clean": score(said, *_with(clean, recognised))}
    if voice == APART:
        return result
    result["rival"] = score(said, *_with(clean, keyphrases))
    few, said = stream(voice, mine[offset % 3 :: 3])
    for ratio in NOISES:
        result[f"noise_{ratio}"] = score(said, *_with(noisy(few, ratio), recognised))
    plain, none = stream(voice, PLAIN_SENTENCES)
    result["plain"] = score(none, *_with(plain, recognised))
    result["plain_rival"] = score(none, *_with(plain, keyphrases))
    return result


def _with(sound: np.ndarray, listener: Listener) -> tuple[Heard, np.ndarray, float]:
    heard, cpu = listener(sound)
    return heard, sound, cpu


def memory() -> int:
    """What the process of the recogniser holds while it hears [MiB]."""
    others = set(psutil.Process().children())  # of multiprocessing
    process = RecogniserProcess(triggers(load_banks()))
    process.push(("file", 1), 0.0, speak("hibari", KEYWORD_SENTENCES[0]), last=True)
    while not process.words():
        time.sleep(0.1)
    (child,) = set(psutil.Process().children()) - others
    held = round(child.memory_info().rss / 2**20)
    process.close()
    return held


def main() -> None:
    names = (*COUNTED, APART)
    with ProcessPoolExecutor(4, get_context("spawn")) as pool:
        found = list(tqdm(pool.map(measure, names, range(len(names))), "voices", len(names), file=sys.stderr))
    results = dict(zip(names, found, strict=True))

    def total(part: str) -> Score:
        scores = [results[name][part] for name in COUNTED]
        return sum(scores[1:], scores[0])

    def a_minute(part: str) -> float:
        return round(60 * total(part).found / total(part).sound, 2)

    ours, rival = total("clean").told(), total("rival").told()
    result = {
        "bench": "keywords",
        **ours,
        "memory_mb": memory(),
        "false_alarms_per_minute": a_minute("plain"),
        "plain_minutes": round(total("plain").sound / 60, 1),
        **{f"noise_{ratio}_db": total(f"noise_{ratio}").told() for ratio in NOISES},
        "by_voice": {name: results[name]["clean"].told() for name in names},
        "keyphrase_mode": {**rival, "false_alarms_per_minute": a_minute("plain_rival")},
        "ratio_precision": round(ours["precision"] / max(rival["precision"], 1e-3), 2),
        "ratio_recall": round(ours["recall"] / max(rival["recall"], 1e-3), 2),
        "sentences": len(KEYWORD_SENTENCES),
        "machine": machine(),
    }
    for name, value in result.items():
        print(f"{name}: {value}")
    print(json.dumps(result))


if __name__ == "__main__":
    main()
