"""From folders of recordings to a database: finding the files, and importing them side by side."""

import hashlib
import multiprocessing
import os
import signal
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

from gesture_bot.base.errors import GestureBotError, InvalidValueError
from gesture_bot.corpus.importing import Job, import_file
from gesture_bot.corpus.readers import READERS
from gesture_bot.corpus.skeletons import SOUNDS, SkeletonMap


def find_jobs(sources: Sequence[Path], skeletons: Sequence[SkeletonMap], parts: Path) -> list[Job]:
    """The files to import, in an order that does not depend on the file system; each once.

    Args:
        sources: Files, and folders that are searched through with all that is in them.
        skeletons: The skeleton maps to choose from.
        parts: Folder for what comes out of the files.

    Raises:
        InvalidValueError: A source does not exist, is no recording, or holds none.
    """
    files: dict[str, tuple[Path, str]] = {}
    around: set[Path] = set()
    for source in sources:
        if not source.exists():
            raise InvalidValueError("there is no file or folder", str(source))
        found = sorted(source.rglob("*")) if source.is_dir() else [source]
        recordings = [path for path in found if path.is_file() and _is_recording(path)]
        if not recordings:
            raise InvalidValueError("no recordings in", str(source), [reader.KIND for reader in READERS])
        for path in recordings:
            files.setdefault(os.path.abspath(path), (path, str(path.relative_to(source.parent))))
        around.update(found)
    for folder in {source.parent for source in sources if source.is_file()}:
        around.update(folder.iterdir())
    sounds: dict[str, set[Path]] = {}
    for path in around:
        if path.suffix.lower() in SOUNDS:
            sounds.setdefault(path.stem, set()).add(path)
    made_by = f"{_code()} {skeletons}"
    jobs = []
    for place, (path, name) in files.items():
        stems = {skeleton.sound_stem(path.stem) for skeleton in skeletons}
        heard = tuple(sorted(sound for stem in stems for sound in sounds.get(stem, ())))
        made_from = os.fsencode(f"{place} {name} {heard} {made_by}")
        key = hashlib.blake2b(made_from, digest_size=16).hexdigest()
        jobs.append(Job(path, name, heard, tuple(skeletons), parts / f"{key}.npz"))
    return jobs


def import_files(jobs: Sequence[Job], workers: int) -> Iterator[str]:
    """Import files side by side in processes, or one by one in this one.

    Yields:
        For each job, in their order, why its file is left out, or an empty text.

    Raises:
        GestureBotError: A process ended by itself, or what was imported cannot be kept.
    """
    if workers == 1:
        yield from map(import_file, jobs)
        return
    # The processes are forked from one that has imported this module and nothing else.
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([__name__])
    # Ctrl-C reaches all processes of a terminal. This one alone decides: the others inherit the block.
    signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    pool = ProcessPoolExecutor(workers, context)
    try:
        imported = [pool.submit(import_file, job) for job in jobs]
        signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
        for future in imported:
            yield future.result()
    except BrokenProcessPool as error:
        raise GestureBotError(
            "a process that imports files has ended; is memory short? What is done is kept: "
            "the same command with fewer --workers goes on from there"
        ) from error
    finally:  # after Ctrl-C, the files in work are not waited for
        for process in multiprocessing.active_children():
            process.terminate()
        pool.shutdown()


def _is_recording(path: Path) -> bool:
    return not path.name.startswith(".") and any(reader.fits(path) for reader in READERS)


def _code() -> str:
    """Digest of the code that imports: parts made by other code are not taken up."""
    digest = hashlib.blake2b(digest_size=16)
    for room in ("base", "corpus", "speech"):
        for source in sorted((Path(__file__).parents[1] / room).glob("*.py")):
            digest.update(source.read_bytes())
    return digest.hexdigest()
