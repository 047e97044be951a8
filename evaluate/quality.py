"""How good is the motion: MM22's table 3 in numbers instead of votes."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gesture_bot.base.frames import FRAME_RATE
from gesture_bot.corpus.database import Database
from gesture_bot.evaluate.beat_scores import BEAT_CONSISTENCY, pmb
from gesture_bot.evaluate.bone_error import BONE_ERROR
from gesture_bot.evaluate.encoder import Encoder, fgd
from gesture_bot.evaluate.kinematics import KINEMATIC_DISTANCE
from gesture_bot.evaluate.lexicon import diversity
from gesture_bot.evaluate.pieces import Motion, Performance, Piece, mismatched, pieces_of
from gesture_bot.evaluate.position_errors import MAD, MAJE
from gesture_bot.evaluate.resampling import Estimate, Metric, estimate
from gesture_bot.evaluate.rhythm import THRESHOLDS
from gesture_bot.evaluate.seams import evenness
from gesture_bot.evaluate.systems import SMOOTHED, systems_of
from gesture_bot.refine.model import RefinementModel


@dataclass(frozen=True)
class Row:
    """What the metrics say of a system.

    Attributes:
        system: Its name.
        smoothed: See systems.System.
        estimates: Of each metric, by its name.
        differences: To the system that is smoothed alone, from the same draws of pieces.
        curve: (31,) PMB within each of rhythm.THRESHOLDS [%] (RG22, figure 11).
    """

    system: str
    smoothed: str
    estimates: dict[str, Estimate]
    differences: dict[str, Estimate]
    curve: np.ndarray


@dataclass(frozen=True)
class Quality:
    """The table.

    Attributes:
        metrics: Its columns.
        rows: Recorded motion first.
        pieces: Of speech that were drawn from.
        minutes: Of recorded motion.
    """

    metrics: list[Metric]
    rows: list[Row]
    pieces: int
    minutes: float


def metrics_of(database: Database) -> list[Metric]:
    """All metrics; the lexicon is that of a database."""
    return [
        MAJE, MAD, fgd(Encoder()), KINEMATIC_DISTANCE,
        pmb(0.1), pmb(0.2), BEAT_CONSISTENCY, diversity(database),
        evenness(3, "inside"), evenness(3, "at seams"),
        evenness(2, "inside"), evenness(2, "at seams"), BONE_ERROR,
    ]  # fmt: skip


def quality_table(
    database: Database, performances: Sequence[Performance], model: RefinementModel | None = None
) -> Quality:
    """Let every system show motion to performances, and judge it.

    Args:
        database: What the k-NN systems search; it must not hold the performances.
        performances: Speech, and the speaker's own motion.
        model: A refinement network, as another row.

    Raises:
        InvalidValueError: There is too little to judge by.
    """
    metrics = metrics_of(database)
    recorded = pieces_of(performances, [Motion(performance.recorded) for performance in performances])
    judged = [
        ("held-out recorded motion", "no", recorded),
        ("mismatched speech and motion", "no", mismatched(recorded)),
    ]
    for system in systems_of(database, model):
        shown = pieces_of(performances, system.show(tuple(performances)))
        judged.append((system.name, system.smoothed, shown))
    estimates = {
        name: {metric.name: estimate(metric, pieces) for metric in metrics} for name, _, pieces in judged
    }
    rows = [
        Row(
            name,
            smoothed,
            estimates[name],
            {what: one.minus(estimates[SMOOTHED][what]) for what, one in estimates[name].items()},
            pmb_curve(pieces),
        )
        for name, smoothed, pieces in judged
    ]
    frames = sum(len(piece.recorded) for piece in recorded)
    return Quality(metrics, rows, len(recorded), frames / FRAME_RATE / 60)


def pmb_curve(pieces: Sequence[Piece]) -> np.ndarray:
    """PMB within each of rhythm.THRESHOLDS [%]; NaN where beats are not known."""
    return np.array([_value(pmb(within), pieces) for within in THRESHOLDS])


def _value(metric: Metric, pieces: Sequence[Piece]) -> float:
    return float(metric.value(metric.sums(pieces).sum(axis=0)))
