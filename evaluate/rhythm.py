"""Do the hands move on the beat of the speech: PMB (RG22, figure 11), for any database."""

import csv
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from gesture_bot.base.files import write_whole
from gesture_bot.base.frames import FRAME_RATE
from gesture_bot.base.keypoints import WRISTS
from gesture_bot.corpus.database import Database
from gesture_bot.matching.emotions import NEUTRAL
from gesture_bot.matching.rhythm import motion_beats
from gesture_bot.matching.selector import Selector
from gesture_bot.refine.offline import LEAD_IN, SpokenMotion, spoken_motion
from gesture_bot.speech.beats import speech_beats
from gesture_bot.speech.streaming import speech_frames

THRESHOLDS = np.arange(31) / 100
"""Of the curve [s]. RG22 takes 0.2 s."""

RUNS, K = 4, 4
"""Motion is made so often, each window drawn from so many best matches: once gives few beats to count."""

SHIFTS = 20
"""The beats of the speech are shifted so often, to tell what chance alone would match."""

STAGES = ("found", "refined", "recorded")
"""Motion that is measured; see Row."""

_COLORS = {False: "#59636e", True: "#1f6fb2"}


"""No emotion takes part: all motion of the database may be chosen."""


@dataclass(frozen=True)
class Speech:
    """Something said, and the motion that was recorded with it.

    Attributes:
        samples: (n,) mono samples at audio.SAMPLE_RATE, full scale 1.
        recorded: (m, 17, 3) keypoints [m], 15 frames a second, from the first sample on; None without any.
    """

    samples: np.ndarray
    recorded: np.ndarray | None = None


@dataclass(frozen=True)
class Motion:
    """Motion that goes with speech.

    Attributes:
        moves: (m,) rising beats of the motion [s].
        beats: (b,) rising beats of the speech [s].
        length: Of the speech [s].
        seconds: Of motion that was looked at [s].
        jerks: (j,) of the wrists, one a frame [m/s3].
    """

    moves: np.ndarray
    beats: np.ndarray
    length: float
    seconds: float
    jerks: np.ndarray


@dataclass(frozen=True)
class Row:
    """How one kind of motion keeps the rhythm.

    Attributes:
        name: `found`: windows as the search chose them, each by itself; `refined`; or `recorded`, the
            speakers' own motion.
        aligned: Whether windows were aligned with beats.
        rate: Beats of the motion a second.
        curve: (31,) PMB within each of THRESHOLDS.
        chance: (31,) The same with the beats of the speech shifted in time.
        jerk: Mean [m/s3].
    """

    name: str
    aligned: bool
    rate: float
    curve: np.ndarray
    chance: np.ndarray
    jerk: float

    def within(self, threshold: float) -> tuple[float, float]:
        """PMB and what chance makes of it, at one of THRESHOLDS [s]."""
        place = int(np.abs(THRESHOLDS - threshold).argmin())
        return float(self.curve[place]), float(self.chance[place])


def matched(moves: np.ndarray, beats: np.ndarray, within: float) -> int:
    """How many beats of a motion have one of the speech near them, each of which counts once.

    Args:
        moves: (m,) rising beats of the motion [s].
        beats: (b,) rising beats of the speech [s].
        within: Largest distance [s].
    """
    count = place = 0
    for move in moves:
        # The first beat in reach is the one that later moves need least.
        while place < len(beats) and beats[place] < move - within - 1e-9:
            place += 1
        if place < len(beats) and beats[place] <= move + within + 1e-9:
            count, place = count + 1, place + 1
    return count


def rhythm_table(database: Database, speeches: Iterable[Speech]) -> list[Row]:
    """Make motion for speech with and without alignment, and measure it.

    Args:
        database: Where the motion comes from.
        speeches: What is said; each begins at rest.

    Raises:
        InvalidValueError: There is no speech, or nothing moves to it.
    """
    motions: dict[tuple[str, bool], list[Motion]] = {}
    for speech in speeches:
        heard, beats = speech_frames(speech.samples), speech_beats(speech.samples)
        length = len(heard) / FRAME_RATE
        for aligned, seed in product((False, True), range(RUNS)):
            selector = Selector(database, {}, NEUTRAL, K, seed=seed, align_beats=aligned)
            motion = spoken_motion(selector, heard)
            motions.setdefault(("found", aligned), []).append(_found(motion, beats, length))
            motions.setdefault(("refined", aligned), []).append(_refined(motion, beats, length))
        if speech.recorded is not None:
            recorded = speech.recorded[: len(heard)]
            motions.setdefault(("recorded", False), []).append(
                Motion(
                    motion_beats(recorded) / FRAME_RATE,
                    beats,
                    length,
                    len(recorded) / FRAME_RATE,
                    jerk(recorded),
                )
            )
    ranked = sorted(motions.items(), key=lambda item: STAGES.index(item[0][0]))
    return [_row(name, aligned, made) for (name, aligned), made in ranked]


def jerk(keypoints: np.ndarray) -> np.ndarray:
    """Mean jerk of the two wrists, (n, 17, 3) -> (n - 3,) [m/s3]."""
    third = np.diff(keypoints[:, WRISTS], n=3, axis=0) * FRAME_RATE**3
    return np.linalg.norm(third, axis=-1).mean(axis=-1)


def _found(motion: SpokenMotion, beats: np.ndarray, length: float) -> Motion:
    # Each window by itself: a jump to the next one is no motion of its own.
    moves = [motion_beats(window.keypoints) + window.start - LEAD_IN for window in motion.windows]
    jerks = [jerk(window.keypoints) for window in motion.windows]
    return Motion(
        np.concatenate(moves) / FRAME_RATE,
        beats,
        length,
        sum(len(window.keypoints) for window in motion.windows) / FRAME_RATE,
        np.concatenate(jerks),
    )


def _refined(motion: SpokenMotion, beats: np.ndarray, length: float) -> Motion:
    moves = motion_beats(motion.refined.keypoints)
    moves = moves[motion.spoken[np.rint(moves).astype(int)]]
    return Motion(
        (moves + motion.refined.start - LEAD_IN) / FRAME_RATE,
        beats,
        length,
        motion.spoken.sum() / FRAME_RATE,
        jerk(motion.refined.keypoints)[motion.spoken[1:-2]],
    )


def _row(name: str, aligned: bool, motions: Sequence[Motion]) -> Row:
    count = sum(len(motion.moves) for motion in motions)
    generator = np.random.default_rng(0)
    heard = [(motion.moves, motion.beats) for motion in motions]
    shifted = [
        (motion.moves, np.sort((motion.beats + share * motion.length) % motion.length))
        for motion in motions
        for share in generator.uniform(size=SHIFTS)
    ]
    return Row(
        name,
        aligned,
        count / sum(motion.seconds for motion in motions),
        _matches(heard) / (count or np.nan),
        _matches(shifted) / (SHIFTS * count or np.nan),
        float(np.concatenate([motion.jerks for motion in motions]).mean()),
    )


def _matches(pairs: Sequence[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """(31,) matches of beats of motion and of speech, within each of THRESHOLDS."""
    return np.array([sum(matched(moves, beats, within) for moves, beats in pairs) for within in THRESHOLDS])


def write_rhythm_table(path: Path, rows: Sequence[Row]) -> None:
    """Write the table as CSV, a line a motion, in SI units.

    Args:
        path: File to write.
        rows: The table.
    """
    with write_whole(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        curve = [f"{kind}_{threshold:.2f}_s" for kind in ("pmb", "chance") for threshold in THRESHOLDS]
        writer.writerow(["motion", "aligned", "beats_per_second", "jerk", *curve])
        for row in rows:
            writer.writerow([row.name, row.aligned, row.rate, row.jerk, *row.curve, *row.chance])


def write_rhythm_picture(path: Path, rows: Sequence[Row]) -> None:
    """Draw PMB against the threshold, as RG22's figure 11, and chance as broken lines.

    Args:
        path: File to write, ending in .png.
        rows: The table.
    """
    stages = [stage for stage in STAGES if any(row.name == stage for row in rows)]
    figure = Figure(figsize=(4.5 * len(stages), 4), dpi=100, layout="constrained")
    for axes, stage in zip(
        figure.subplots(1, len(stages), squeeze=False, sharey=True)[0], stages, strict=True
    ):
        for row in rows:
            if row.name == stage:
                color = _COLORS[row.aligned]
                axes.plot(
                    THRESHOLDS, 100 * row.curve, color=color, label="aligned" if row.aligned else "as it is"
                )
                axes.plot(THRESHOLDS, 100 * row.chance, color=color, linestyle="--", linewidth=1)
        axes.set(title=stage, xlabel="threshold [s]", xlim=(0, THRESHOLDS[-1]), ylim=(0, 100))
        axes.grid(alpha=0.3)
        axes.spines[["top", "right"]].set_visible(False)
        axes.legend(frameon=False, loc="lower right", title="broken: by chance")
    figure.supylabel("beats of the motion on a beat of the speech, PMB [%]", fontsize=10)
    with write_whole(path) as temporary:
        figure.savefig(temporary)
