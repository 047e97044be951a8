"""`gesture-bot build-database`: recordings of people who speak and gesture into a database file."""

import argparse
import shlex
import shutil
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

from tqdm import tqdm

from gesture_bot.base.errors import FileFormatError, InvalidValueError
from gesture_bot.base.frames import FRAME_RATE
from gesture_bot.corpus.building import find_jobs, import_files
from gesture_bot.corpus.importing import Job, Source, described, load_part
from gesture_bot.corpus.label_table import labels_by_file, read_label_table
from gesture_bot.corpus.recordings import Recording, build_database
from gesture_bot.corpus.skeletons import load_skeleton, load_skeletons

TOLD = 10
"""Files left out that are told one by one."""

LIBRARIES = ("gesture-bot", "numpy", "scipy", "soxr", "pybvh")


def command(options: argparse.Namespace) -> int:
    """Build a database, or go on with one that was interrupted; the exit status.

    Files that cannot be used are told and left out.

    Raises:
        GestureBotError: An option is not valid, no file can be used, or the database cannot be written.
    """
    if options.workers < 1:
        raise InvalidValueError("number of workers", options.workers, ["1 or more"])
    skeletons = [load_skeleton(options.map)] if options.map else list(load_skeletons().values())
    parts = options.output.with_name(f"{options.output.name}.parts")
    jobs = find_jobs(options.sources, skeletons, parts)
    table = read_label_table(options.labels) if options.labels else {}
    labels = labels_by_file(table, [job.path for job in jobs])

    _make_room(options.output, parts)
    imported = import_files(jobs, min(options.workers, len(jobs)))
    problems = list(tqdm(imported, "importing", len(jobs), unit="file"))
    good = [job for job, problem in zip(jobs, problems, strict=True) if not problem]
    _tell_left_out([problem for problem in problems if problem])
    if not good:
        shutil.rmtree(parts)
        raise FileFormatError(f"no recording to build {options.output} from")

    recordings, sources = _load(good, labels)
    settings = {"map": options.map or "found by itself", "future": options.future}
    metadata = {
        "provenance": "recordings",
        "licence": options.licence,
        "sources": [_provenance(source) for source in sources],
        "settings": settings,
        "versions": {library: version(library) for library in LIBRARIES},
    }
    database = build_database(recordings, metadata, options.future)
    database.save(options.output)
    shutil.rmtree(parts)

    minutes = sum(len(recording.keypoints) for recording in recordings) / FRAME_RATE / 60
    length = f"{minutes:.1f} minutes" if minutes < 60 else f"{minutes / 60:.1f} hours"
    sequences = len(database.starts)
    print(f"wrote {options.output}: {length}, {sequences} sequences, from {len(good)} of {len(jobs)} files")
    for kind, names in database.names.items():
        if names:
            print(f"{kind}: {', '.join(names)}")
    print(described(sum((Counter(source.frames) for source in sources), Counter())))
    name = shlex.quote(str(options.output))
    print(f"next: gesture-bot inspect {name}\n      gesture-bot run database:={name}")
    return 0


def _make_room(output: Path, parts: Path) -> None:
    """Make the folder beside the database where imported files wait for it."""
    if output.is_dir():
        raise FileFormatError(f"cannot write {output} (it is a folder)")
    try:
        parts.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileFormatError(f"cannot write {output} ({error.strerror})") from error


def _tell_left_out(problems: Sequence[str]) -> None:
    for problem in problems[:TOLD]:
        print(f"left out: {problem}", file=sys.stderr)
    if len(problems) > TOLD:
        print(f"left out: {len(problems) - TOLD} more files", file=sys.stderr)


def _load(jobs: Sequence[Job], labels: dict[Path, dict[str, str]]) -> tuple[list[Recording], list[Source]]:
    """All that was imported; labels of the table before those of the files."""
    recordings, sources = [], []
    for job in jobs:
        made, source = load_part(job.part)
        sources.append(source)
        for recording in made:
            both = {**recording.labels, **labels[job.path]}
            recordings.append(Recording(recording.name, recording.keypoints, recording.features, both))
    return recordings, sources


def _provenance(source: Source) -> dict[str, Any]:
    """A source without the folders of the machine that it was read on."""
    digests = {Path(path).name: digest for path, digest in source.digests.items()}
    return {**asdict(source), "digests": digests}
