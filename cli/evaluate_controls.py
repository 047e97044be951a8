"""`gesture-bot evaluate controls`: the control table of MM22 for a database."""

import argparse
from collections.abc import Sequence

from rich.console import Console
from rich.table import Table

from gesture_bot.corpus.demo import load_database
from gesture_bot.evaluate.control_table import (
    LIVELY,
    NEAR,
    Outcome,
    Row,
    Spread,
    control_table,
    write_control_table,
)
from gesture_bot.evaluate.held_sentences import held_speech, with_pauses
from gesture_bot.refine.model import load_model
from gesture_bot.speech.audio import load_audio
from gesture_bot.speech.streaming import speech_frames

_MM22 = {
    "high": ("22.2", "25.6 (3.4)", "23.4 (4.2)"),
    "low": ("9.7", "8.5 (2.1)", "9.1 (2.9)"),
    "fast": ("19.1", "22.8 (12.0)", "17.5 (10.3)"),
    "slow": ("3", "5.9 (3.8)", "5.4 (4.1)"),
    "asymmetric": ("10", "12.2 (3.0)", "10.4 (3.9)"),
    "symmetric": ("0", "1.0 (1.2)", "2.1 (2.0)"),
}
"""MM22's table 2 [cm, cm/s]: threshold, found by the search (k-NN), refined (k-NN and cGAN)."""

_NOTES = f"""
Mean (standard deviation) in cm, of speeds in cm/s.
windows  share of the database's windows that the control leaves
short    what is missing to the threshold, on average over all frames
free     the same quantity without the control
varies   the deviation as a share of the free one; in brackets, that of all windows left
hands    how far the wrists go from their mean places, as a share of the free motion
holds    the mean is on its side of the threshold or within {NEAR:.0%} of it, and varies {LIVELY:.0%} or more
MM22     threshold and outcome there"""

_WIDTH = 124
"""Of the table [characters]; a narrower terminal breaks its lines."""


def command(options: argparse.Namespace) -> int:
    """Print the table for `options.database` and `options.speech`, and write it; the exit status.

    Raises:
        GestureBotError: A file cannot be read or written, or holds no speech.
    """
    files = options.speech
    samples = with_pauses(load_audio(file) for file in files) if files else held_speech()
    database = load_database(options.database)
    model = load_model(options.model, database)
    rows = control_table(database, speech_frames(samples), model)
    console = Console(highlight=False, markup=False, width=_WIDTH)
    console.print(_table("Found by the search", rows, [row.found for row in rows], 1))
    console.print(
        _table(
            f"After {'refinement by the network' if model else 'smoothing'}",
            rows,
            [row.refined for row in rows],
            2,
        )
    )
    console.print(_NOTES)
    for row in rows:
        console.print(f"{row.name:<10} {row.constraint}")
    for row in rows:
        for relaxed in row.relaxed:
            console.print(f"{row.name}: {relaxed}")
    if options.output:
        write_control_table(options.output, rows)
        console.print(f"wrote {options.output}", soft_wrap=True)
    return 0


def _table(title: str, rows: Sequence[Row], outcomes: Sequence[Outcome], mm22: int) -> Table:
    table = Table(title=title, title_justify="left", title_style="bold", box=None, pad_edge=False)
    for column in ("", "threshold", "windows", "mean", "short", "free", "varies", "hands", "holds", "MM22"):
        table.add_column(column, no_wrap=True, justify="left" if column in ("", "holds") else "right")
    for row, outcome in zip(rows, outcomes, strict=True):
        missed = row.missed(outcome)
        possible = row.left.share_of(outcome.free)
        paper = _MM22.get(row.name)
        table.add_row(
            row.name,
            f"{100 * row.threshold:.1f}",
            f"{row.share:.1%}",
            _cm(outcome.controlled),
            f"{100 * outcome.short:.1f}",
            _cm(outcome.free),
            f"{outcome.variation:.0%} ({possible:.0%})",
            f"{outcome.hands:.0%}",
            f"no: {' and '.join(missed)}" if missed else "yes",
            f"{paper[0]}: {paper[mm22]}" if paper else "",
        )
    return table


def _cm(spread: Spread) -> str:
    return f"{100 * spread.mean:.1f} ({100 * spread.deviation:.1f})"
