"""`gesture-bot build-database`: recordings of people who speak and gesture into a database file."""

import argparse
import shlex
import shutil
import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from tqdm import tqdm

from gesture_bot.base.errors import FileFormatError, InvalidValueError
from gesture_bot.base.frames import FRAME_RATE
from gesture_bot.corpus.building import find_jobs, import_files
from gesture_bot.corpus.importing import Job, Source, described, load_recordings, load_source
from gesture_bot.corpus.label_table import labels_by_file, read_label_table
from gesture_bot.corpus.recordings import Recording, build_database
from gesture_bot.corpus.skeletons import load_skeleton, load_skeletons
from gesture_bot.evaluate.database_report import frames_of

TOLD = 10
"""Files left out that are told one by one."""

SOUNDLESS = 0.1
"""Share of a file's motion without sound, from which on that is told."""

LIBRARIES = ("gesture-bot", "numpy", "scipy", "soxr", "pybvh")


def command(options: argparse.Namespace) -> int:
    """Build a database, or go on with one that was interrupted; the exit status.

    Files that cannot be used are told and left out.

    Raises:
        GestureBotError: An option is not valid, no file can be used, or the database cannot be written.
    """
    if options.workers < 1:
        raise InvalidValueError("number of workers", options.workers, ["1 or more"])
    if options.output.suffix != ".safetensors":
        raise InvalidValueError("kind of database file", options.output.name, [".safetensors"])
    skeletons = [load_skeleton(options.map)] if options.map else list(load_skeletons().values())
    parts = options.output.with_name(f"{options.output.name}.parts")
    jobs = find_jobs(options.sources, skeletons, parts)
    table = read_label_table(options.labels) if options.labels else {}
    labels = labels_by_file(table, [job.path for job in jobs])

    _make_room(options.output, parts)
    imported = import_files(jobs, min(options.workers, len(jobs)))
    try:
        problems = list(tqdm(imported, "importing", len(jobs), unit="file", disable=None))
    except KeyboardInterrupt:
        print(f"interrupted; {parts} keeps what is done: the same command goes on there", file=sys.stderr)
        raise
    good = [job for job, problem in zip(jobs, problems, strict=True) if not problem]
    _tell_left_out([problem for problem in problems if problem])
    if not good:
        with suppress(OSError):  # files of an earlier run stay
            parts.rmdir()
        raise FileFormatError(f"no recording to build {options.output} from")

    sources = [load_source(job.part) for job in good]
    settings = {"map": options.map or "found by itself", "future": options.future}
    metadata = {
        "provenance": "recordings",
        "licence": options.licence,
        "sources": [_provenance(source) for source in sources],
        "settings": settings,
        "versions": {library: _version(library) for library in LIBRARIES},
    }
    database = build_database(_recordings(good, labels), metadata, options.future)
    database.save(options.output)
    shutil.rmtree(parts, ignore_errors=True)

    minutes = len(frames_of(database)) / FRAME_RATE / 60
    length = f"{minutes:.1f} minutes" if minutes < 60 else f"{minutes / 60:.1f} hours"
    sequences = len(database.starts)
    print(f"wrote {options.output}: {length}, {sequences} sequences, from {len(good)} of {len(jobs)} files")
    for kind, names in database.names.items():
        if names:
            print(f"{kind}: {', '.join(names)}")
    _tell_soundless(sources)
    print(described(sum((Counter(source.frames) for source in sources), Counter())))
    name = shlex.quote(str(options.output))
    print(f"next: gesture-bot inspect {name}\n      gesture-bot run database:={name}")
    return 0


def _make_room(output: Path, parts: Path) -> None:
    """Make the folder beside the database where imported files wait for it."""
    if output.exists() and not output.is_file():
        raise FileFormatError(f"cannot write {output} (it is {'a folder' if output.is_dir() else 'no file'})")
    try:
        parts.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileFormatError(f"cannot write {output} ({error.strerror})") from error


def _tell_left_out(problems: Sequence[str]) -> None:
    for problem in problems[:TOLD]:
        print(f"left out: {problem}", file=sys.stderr)
    if len(problems) > TOLD:
        print(f"left out: {len(problems) - TOLD} more files", file=sys.stderr)


def _tell_soundless(sources: Sequence[Source]) -> None:
    """Name the files whose sound ends long before their motion: is it the right sound, and whole?"""
    for source in sources:
        lost, read = source.frames.get("soundless", 0), source.frames["read"]
        if lost > SOUNDLESS * read:
            print(f"note: the sound of {source.name} ends early: {lost} of {read} frames", file=sys.stderr)


def _recordings(jobs: Sequence[Job], labels: Mapping[Path, Mapping[str, str]]) -> Iterator[Recording]:
    """All that was imported, file by file; labels of the table before those of the files."""
    for job in jobs:
        for recording in load_recordings(job.part):
            yield replace(recording, labels={**recording.labels, **labels[job.path]})


def _version(library: str) -> str:
    try:
        return version(library)
    except PackageNotFoundError:  # a ROS workspace does not list its packages for Python
        return "not stated"


def _provenance(source: Source) -> dict[str, Any]:
    """A source without the folders of the machine that it was read on."""
    digests = {Path(path).name: digest for path, digest in source.digests.items()}
    return {**asdict(source), "digests": digests}
