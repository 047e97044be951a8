"""How fast the search is, beside plain NumPy and one flat FAISS scan, and whether it finds the same.

`make bench-search`; one thread for everybody; the last line is one JSON object.
"""

import json
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import faiss
import numpy as np
import psutil
from machine import machine
from threadpoolctl import threadpool_limits
from tqdm import tqdm

from gesture_bot.base.frames import WINDOW
from gesture_bot.corpus.database import SEQUENCE, Database
from gesture_bot.corpus.demo import demo_database
from gesture_bot.matching.features import poses, sounds
from gesture_bot.matching.reference import Reference
from gesture_bot.matching.search import POSITIONS, PRESELECTIONS, Search, eligible, ranks_of

sys.path.insert(0, str(Path(__file__).parents[1] / "test"))
from large_database import large_database, random_mask  # noqa: E402  from test/

THREADS = 1
SHARES = (0.02, 0.15, 0.5, 1.0)
PAPER, LONG = 9624, 100_000
STEPS = 40
"""Searches of a walk; each goes on from the window found before, with the sound that comes next."""


class PlainNumPy:
    """The method in straightforward single-precision NumPy, its features stacked beforehand."""

    def __init__(self, database: Database) -> None:
        rows = (database.starts[:, None] + np.arange(POSITIONS)).ravel()
        self.poses = poses(database).at(rows).astype(np.float32).reshape(-1, POSITIONS, 96)
        self.sounds = sounds(database).at(rows).astype(np.float32).reshape(-1, POSITIONS, 112)

    def find(self, pose: np.ndarray, audio: np.ndarray, allowed: np.ndarray) -> int:
        """The sequence that goes on best."""
        distances = np.sqrt(((self.poses - pose) ** 2).sum(axis=-1))
        distances[~allowed | (distances == 0)] = np.inf
        frames = distances.argmin(axis=1)
        sequences = np.arange(len(frames))
        nearest = distances[sequences, frames]
        chosen = self.sounds[sequences, frames]
        cosine = 1 - chosen @ audio / (np.linalg.norm(chosen, axis=1) * np.linalg.norm(audio))
        cosine[np.isinf(nearest)] = np.inf
        return int(np.argmin(ranks_of(nearest) + ranks_of(cosine)))


def timed(call: Callable[[], object]) -> tuple[object, float]:
    begin = time.perf_counter()
    result = call()
    return result, (time.perf_counter() - begin) * 1e3


def walk(search: Search, speech: Database, mask: np.ndarray, steps: int) -> list[float]:
    """Time [ms] of searches that follow each other, to the sound of another recording."""
    row, times = search.row(0, 0), []
    for step in range(steps):
        pose, audio = search.pose_at(row), search.audio_of(speech.features[WINDOW * step :])
        match, taken = timed(lambda: search.find(pose, audio, mask))  # noqa: B023  called at once
        times.append(taken)
        row = search.row(match.sequence, match.frame + WINDOW - 1)
    return times


def compare(database: Database, search: Search, speech: Database) -> dict[str, list[float]]:
    """Time [ms] of every contender at the steps of a walk through the whole database, in turn."""
    plain = PlainNumPy(database)
    index = faiss.IndexFlatL2(96)
    index.add(plain.poses.reshape(-1, 96))
    mask = np.ones((len(database.starts), SEQUENCE), bool)
    allowed = eligible(mask)
    times: dict[str, list[float]] = {"ours": [], "numpy": [], "faiss": []}
    row = search.row(0, 0)
    for step in tqdm(range(STEPS), "against NumPy and FAISS", unit="search"):
        pose, audio = search.pose_at(row), search.audio_of(speech.features[WINDOW * step :])
        single, heard = pose.astype(np.float32), audio.astype(np.float32)
        contenders = {
            "ours": lambda: search.find(pose, audio, mask),  # noqa: B023  called at once
            "faiss": lambda: index.search(single[None], 1),  # noqa: B023
            "numpy": lambda: plain.find(single, heard, allowed),  # noqa: B023
        }
        # So each finds the caches as often as one of the others has left them as the other.
        for name in ("numpy", "ours", "faiss") if step % 2 else ("numpy", "faiss", "ours"):
            result, taken = timed(contenders[name])
            times[name].append(taken)
            if name == "ours":
                match = result
        row = search.row(match.sequence, match.frame + WINDOW - 1)
    return times


def mismatches(database: Database, search: Search, queries: int) -> int:
    """Random queries on which the search and the reference do not find the same."""
    plain, generator, differing = Reference(database), np.random.default_rng(1), 0
    for query in tqdm(range(queries), f"against the reference, {len(database.starts)} sequences"):
        pose_row, audio_row = generator.integers(0, len(database.keypoints) - SEQUENCE, 2)
        pose, audio = search.pose_at(pose_row), search.audio_of(database.features[audio_row:])
        if query % 4 == 0:
            pose, audio = pose + generator.normal(size=96), audio + 0.3 * generator.normal(size=112)
        mask = random_mask(generator, len(database.starts), generator.choice(SHARES))
        settings = int(generator.integers(1, 16)), PRESELECTIONS[query % len(PRESELECTIONS)]
        found = search.find(pose, audio, mask, *settings)
        differing += found != plain.find(pose, audio, mask, *settings)
    return differing


def measure_long(path: Path) -> dict[str, float]:
    """Time and memory of a search through a mapped file, in a process of its own."""
    threadpool_limits(THREADS)
    database, loading = timed(lambda: Database.load(path))
    search, building = timed(lambda: Search(database))
    times = walk(search, large_database(10, seed=1), np.ones((len(database.starts), SEQUENCE), bool), STEPS)
    return {
        "ms_100000": round(float(np.median(times[3:])), 2),
        "memory_mb_100000": round(psutil.Process().memory_info().rss / 2**20),
        "loading_s_100000": round(loading / 1e3, 1),
        "building_s_100000": round(building / 1e3, 1),
    }


def print_variances(database: Database) -> None:
    """Variance of the pose features beyond their first principal axes, beside the demo corpus."""
    for name, one in (("synthetic", database), ("demo corpus", Database.load(demo_database()))):
        rows = (one.starts[::5, None] + np.arange(POSITIONS)).ravel()
        variances = np.linalg.eigvalsh(np.cov(poses(one).at(rows).T))[::-1]
        left = 1 - variances.cumsum() / variances.sum()
        shares = ", ".join(f"{axes}: {left[axes - 1]:.2%}" for axes in (4, 8, 16, 24, 32, 48))
        print(f"variance of the pose features beyond their first axes, {name}: {shares}")


def main() -> None:
    threadpool_limits(THREADS)
    faiss.omp_set_num_threads(THREADS)
    speech = large_database(10, seed=1)
    database = large_database(PAPER, repeated=100)
    print_variances(database)
    search, building = timed(lambda: Search(database))  # noqa: F821  deleted below
    times = compare(database, search, speech)
    generator = np.random.default_rng(2)
    masked = {
        share: np.median(walk(search, speech, random_mask(generator, PAPER, share), STEPS))
        for share in SHARES
    }
    bandwidth = read_bandwidth()
    touched = bytes_touched(search, PAPER)
    ours, numpy, flat = (float(np.median(times[name])) for name in ("ours", "numpy", "faiss"))
    quantiles = {
        name: {f"{share:.0%}": round(float(np.quantile(taken, share)), 2) for share in (0.1, 0.5, 0.9)}
        for name, taken in times.items()
    }
    differing = mismatches(database, search, 1000)
    small = large_database(1000, repeated=50)
    differing += mismatches(small, Search(small), 1000)
    del database, search, small
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "long.safetensors"
        large_database(LONG).save(path)
        with ProcessPoolExecutor(1, get_context("spawn")) as pool:
            long = pool.submit(measure_long, path).result()
    result = {
        "bench": "search",
        "ratio_numpy": round(numpy / ours, 1),
        "ratio_faiss": round(flat / ours, 2),
        "ms_9624": round(ours, 2),
        **long,
        "mismatches": differing,
        "quantiles_ms": quantiles,
        "masked_ms": {f"{share:.0%}": round(float(taken), 2) for share, taken in masked.items()},
        "building_s_9624": round(building / 1e3, 1),
        "bytes_touched": touched,
        "read_bandwidth_gb_s": round(bandwidth, 1),
        "bytes_share": round(touched / (bandwidth * 1e9) / (ours / 1e3), 2),
        "threads": THREADS,
        "machine": machine(),
    }
    for name, value in result.items():
        print(f"{name}: {value}")
    print(json.dumps(result))


def bytes_touched(search: Search, sequences: int) -> int:
    """The least that a search reads: the mask, the codes of all poses, and one window of sound a sequence."""
    codes = search._pose_bytes
    poses = sum(array.nbytes for array in (codes.codes, codes.squares, codes.errors, codes.rests))
    return poses + sequences * (SEQUENCE + 112 + 4)


def read_bandwidth() -> float:
    """How fast one thread reads memory [GB/s]."""
    numbers = np.ones(2**26, np.float32)
    return numbers.nbytes / 1e6 / min(timed(numbers.max)[1] for _ in range(9))


if __name__ == "__main__":
    main()
