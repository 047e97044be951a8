"""`gesture-bot evaluate rhythm`: how many of the hands' beats fall on beats of the speech."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table

from gesture_bot.base.errors import FileFormatError, InvalidValueError
from gesture_bot.corpus.demo import load_database
from gesture_bot.corpus.readers import READERS, reader_of
from gesture_bot.corpus.skeletons import SOUNDS, choose_skeleton, load_skeletons
from gesture_bot.corpus.takes import motion_of
from gesture_bot.evaluate.held_sentences import held_speech
from gesture_bot.evaluate.rhythm import (
    RUNS,
    SHIFTS,
    K,
    Row,
    Speech,
    rhythm_table,
    write_rhythm_picture,
    write_rhythm_table,
)
from gesture_bot.speech.audio import load_audio

FORMATS = (".png", ".csv")

_THRESHOLDS = (0.1, 0.2)
"""Of the columns [s]; RG22 takes 0.2 s."""

_NOTES = f"""
Made {RUNS} times, each window drawn from the {K} best.
found   windows as the search chose them, each by itself
PMB     share of the hands' beats (hardest braking) within so many seconds of a beat of the speech, each
        of which counts once (RG22: 0.2 s; on Trinity, people 95.7%, theirs 91.4%)
chance  the same with the beats of the speech shifted by a random time, mean of {SHIFTS}
jerk    mean of both wrists [m/s3]"""


def command(options: argparse.Namespace) -> int:
    """Print the table for `options.database` and `options.speech`, and write it or its curves; exit status.

    Raises:
        GestureBotError: A file cannot be read or written, or holds no speech.
    """
    output = options.output
    if output and output.suffix not in FORMATS:
        raise InvalidValueError("cannot write the rhythm to this kind of file", output.name, FORMATS)
    speeches = [_speech(file) for file in options.speech] or [Speech(held_speech())]
    rows = rhythm_table(load_database(options.database), speeches)
    console = Console(highlight=False, markup=False, width=110)
    console.print(_table(rows))
    console.print(_NOTES)
    if output:
        (write_rhythm_picture if output.suffix == ".png" else write_rhythm_table)(output, rows)
        console.print(f"wrote {output}", soft_wrap=True)
    return 0


def _speech(path: Path) -> Speech:
    """A sound file, or a recording of motion with the sound file beside it."""
    if not any(reader.fits(path) for reader in READERS):
        return Speech(load_audio(path))
    takes = list(reader_of(path).read(path))
    if len(takes) != 1 or takes[0].features is not None:
        raise FileFormatError(f"{path} is no single recording with a sound file beside it")
    skeleton = choose_skeleton(takes[0], path.stem, list(load_skeletons().values()))
    sounds = [file for file in path.absolute().parent.iterdir() if file.suffix.lower() in SOUNDS]
    return Speech(load_audio(skeleton.sound_file(path, sounds)), motion_of(takes[0], skeleton).keypoints)


def _table(rows: Sequence[Row]) -> Table:
    table = Table(box=None, pad_edge=False)
    columns = [title for threshold in _THRESHOLDS for title in (f"PMB {threshold} s", "chance")]
    for column in ("motion", "aligned", "beats/s", *columns, "jerk"):
        table.add_column(column, no_wrap=True, justify="left" if column in ("motion", "aligned") else "right")
    for row in rows:
        shares = [f"{share:.1%}" for threshold in _THRESHOLDS for share in row.within(threshold)]
        aligned = "" if row.name == "recorded" else "yes" if row.aligned else "no"
        table.add_row(row.name, aligned, f"{row.rate:.2f}", *shares, f"{row.jerk:.1f}")
    return table
