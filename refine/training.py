"""Training of the refinement network: the loop, its checkpoints, and the curves."""

import csv
import hashlib
import time
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from matplotlib.figure import Figure
from torch import distributed
from tqdm import tqdm

from gesture_bot.base.errors import FileFormatError, InvalidValueError, TrainingError
from gesture_bot.base.files import write_whole
from gesture_bot.base.frames import WINDOW
from gesture_bot.corpus.database import SEQUENCE, Database
from gesture_bot.refine.export import export
from gesture_bot.refine.gan import RECIPES, Gan
from gesture_bot.refine.missed import Missed
from gesture_bot.refine.model import Card
from gesture_bot.refine.pairs import held_out, walks
from gesture_bot.refine.streaming import refined_motion
from gesture_bot.speech.features import FEATURES

SAVE_EVERY = 60.0
"""Between checkpoints [s]."""

Judge = Callable[[Sequence[np.ndarray], Sequence[np.ndarray]], dict[str, float]]
"""Made and recorded motions, (n, 17, 3) each [m] -> distances by name; the first decides what is best."""

LOSSES = ("distance", "penalty", "change", "missed")
"""Those that the progress bar shows."""


@dataclass(frozen=True)
class Settings:
    """What shapes a model, but for how long it is trained.

    Attributes:
        recipe: Name in gan.RECIPES.
        width: Share of the authors' channels.
        batch: Windows in a batch (MM22's code: 100); of each process, where there are several.
        seed: Of everything drawn at random.
        report_every: Iterations that a row of the curves sums up.
        test_every: Iterations from one look at what is held out to the next; a multiple of report_every.
    """

    recipe: str = "paper"
    width: float = 1.0
    batch: int = 100
    seed: int = 0
    report_every: int = 100
    test_every: int = 500


class Training:
    """A training that goes on where its checkpoint is.

    Beside the model file lie its checkpoint, .pt, and the curves, .csv and .png. The model file is the
    generator that did best so far on the recordings that are held out.

    Args:
        database: What the search searches.
        spoken: Recordings to learn from: for their sound, motion is searched; it may be the same.
        output: The model file, .onnx.
        settings: See Settings.
        judge: Tells how far made motion is from real.

    Attributes:
        iteration: The last one done.
        rows: The curves so far: a row every `report_every` iterations, with the means of the losses.

    Raises:
        InvalidValueError: There are too few recordings.
        FileFormatError: There is a checkpoint of another training.
    """

    def __init__(
        self, database: Database, spoken: Database, output: Path, settings: Settings, judge: Judge
    ) -> None:
        self._databases, self._spoken = (database, spoken), spoken
        self._output, self._settings, self._judge = output, settings, judge
        self.iteration, self.rows = 0, list[dict[str, float]]()
        self._best: dict[str, Any] = {"distances": {}, "iteration": 0, "generator": {}}
        saved = self._read_checkpoint()
        held = held_out(spoken, settings.seed)
        found = walks(database, spoken, held, settings.seed)
        trained = [walk for walk in found if walk.recording not in held]
        self._tested = [walk for walk in found if walk.recording in held]
        rows = np.concatenate([walk.rows for walk in trained])
        steered = RECIPES[settings.recipe].controls
        self._card = Card.of(database, spoken, rows, steered, asdict(settings))
        self._card.training["held_out"] = held.tolist()
        # Every 8 frames (MM22: 5), where the search's windows end, as when they are refined one by one.
        begins = np.cumsum([0, *(len(walk.rows) for walk in trained)])[:-1]
        starts = [
            begin + np.arange(0, len(walk.rows) - SEQUENCE + 1, WINDOW)
            for begin, walk in zip(begins, trained, strict=True)
        ]
        later = [
            np.minimum(WINDOW - 1, len(walk.rows) - SEQUENCE - (begun - begin))
            for begin, begun, walk in zip(begins, starts, trained, strict=True)
        ]
        joined = np.concatenate([walk.joined for walk in trained], axis=1)
        bounds = np.concatenate([walk.bounds for walk in trained])
        heard = self._card.heard_in(np.concatenate([walk.heard for walk in trained]), bounds).T
        self._gan = Gan(
            heard[:, :FEATURES].copy(),
            self._card.gesture_in(spoken.keypoints[rows]).T.copy(),
            np.swapaxes(self._card.gesture_in(joined), 1, 2).copy(),
            heard[:, FEATURES:].copy(),
            Missed(self._card),
            np.concatenate(starts), np.concatenate(later),
            settings.recipe, settings.width, settings.batch, settings.seed,
        )  # fmt: skip
        if saved:
            self._gan.restore(saved["networks"])
            self.iteration, self.rows, self._best = saved["iteration"], saved["rows"], saved["best"]

    @property
    def best(self) -> tuple[int, dict[str, float]]:
        """The iteration of the best generator so far, and its distances from the real motion held out."""
        return self._best["iteration"], self._best["distances"]

    @property
    def checkpoint(self) -> Path:
        """The checkpoint's file."""
        return self._output.with_suffix(".pt")

    def run(self, iterations: int) -> None:
        """Train up to an iteration, with a progress bar.

        Raises:
            TrainingError: It has diverged; the last checkpoint is from before.
            FileFormatError: A file cannot be written.
        """
        every, sums, saved = (
            self._settings.report_every,
            defaultdict[str, list[float]](list),
            time.monotonic(),
        )
        if not self.rows:
            self._report({}, 0)  # what the search alone does
        progress = tqdm(
            range(self.iteration + 1, iterations + 1), "training", iterations, initial=self.iteration,
            unit="iteration", disable=None if _first() else True,
        )  # fmt: skip
        for iteration in progress:
            try:
                losses = self._gan.step(iteration)
            except TrainingError as error:
                if not self.checkpoint.exists():
                    raise
                raise TrainingError(f"{error}; {self.checkpoint} holds iteration {self.iteration}") from error
            for name, value in losses.items():
                sums[name].append(value)
            if iteration % every and iteration != iterations:
                continue
            self._report(
                {name: float(np.mean(values)) for name, values in sums.items()},
                iteration,
                iteration == iterations,
            )
            sums.clear()
            shown = {name: f"{self.rows[-1].get(name, np.nan):.3g}" for name in LOSSES}
            best = {name: f"{value:.3g}" for name, value in self._best["distances"].items()}
            progress.set_postfix(shown | best, refresh=False)
            if time.monotonic() > saved + SAVE_EVERY or iteration == iterations:
                self._save()
                saved = time.monotonic()

    def _report(self, losses: dict[str, float], iteration: int, last: bool = False) -> None:
        """A row of the curves and, now and then, a look at the recordings that are held out."""
        self.rows.append({"iteration": iteration, **losses})
        if iteration % self._settings.test_every and not last:
            return
        refined = partial(self._card.refined, self._gan.run)
        # k = 1 and no controls, as when the robot speaks.
        made = [
            refined_motion(refined, walk.heard, walk.joined[0], np.full_like(walk.bounds, np.nan))
            for walk in self._tested
        ]
        real = [self._spoken.keypoints[walk.rows].astype(np.float64) for walk in self._tested]
        distances = self._judge(made, real)
        self.rows[-1] |= distances
        (name, distance), *_ = distances.items()
        if iteration and distance < self._best["distances"].get(name, np.inf):
            generator = {
                name: value.cpu().clone() for name, value in self._gan.averaged.module.state_dict().items()
            }
            self._best = {"distances": distances, "iteration": iteration, "generator": generator}

    def _save(self) -> None:
        """Checkpoint, curves, and the best model so far."""
        self.iteration = int(self.rows[-1]["iteration"])
        if not _first():
            return
        state = {
            "trained": self._identity(),
            "iteration": self.iteration,
            "rows": self.rows,
            "best": self._best,
            "networks": self._gan.state(),
        }
        with write_whole(self.checkpoint) as temporary:
            torch.save(state, temporary)
        with write_whole(self._output.with_suffix(".csv")) as temporary, temporary.open("w") as file:
            writer = csv.DictWriter(file, dict.fromkeys(name for row in self.rows for name in row))
            writer.writeheader()
            writer.writerows(self.rows)
        with write_whole(self._output.with_suffix(".png")) as temporary:
            _draw(self.rows).savefig(temporary)
        if self._best["iteration"]:
            self._card.training |= {
                "iteration": self._best["iteration"],
                "held_out_distances": self._best["distances"],
            }
            export(self._best["generator"], self._settings.width, self._card, self._output)

    def _identity(self) -> dict[str, Any]:
        """What a checkpoint must have in common with a training that goes on from it."""
        digest = hashlib.blake2b(digest_size=8)
        for database in self._databases:
            for array in (database.starts, database.keypoint_mean, database.feature_mean):
                digest.update(array.tobytes())
        return {"databases": digest.hexdigest(), **asdict(self._settings)}

    def _read_checkpoint(self) -> dict[str, Any] | None:
        if not self.checkpoint.exists():
            return None
        try:
            saved = torch.load(self.checkpoint, map_location="cpu", weights_only=True)
            trained = saved["trained"]
        except Exception as error:  # torch has several
            raise FileFormatError(f"cannot read {self.checkpoint} as a checkpoint ({error})") from error
        for name, value in self._identity().items():
            if trained.get(name) != value:
                raise InvalidValueError(
                    f"{self.checkpoint} is from another training, whose {name} was {trained.get(name)}; "
                    f"move it away, or write to another file. {name} now",
                    value,
                )
        return saved


def _first() -> bool:
    """Whether this process is the one that writes."""
    return not distributed.is_initialized() or distributed.get_rank() == 0


def _draw(rows: list[dict[str, float]]) -> Figure:
    titles = {
        "distance": "critic: real over made",
        "penalty": "gradient penalty",
        "change": "change of the gesture [deviations]",
        "missed": "missed of the bounds [deviations]",
    } | {name: f"held out: {name}" for name in rows[0] if name != "iteration"}
    figure = Figure((3 * len(titles), 3.5), layout="constrained")
    for axes, (name, title) in zip(figure.subplots(1, len(titles)), titles.items(), strict=True):
        known = [(row["iteration"], row[name]) for row in rows if name in row]
        axes.plot(*zip(*known, strict=True), color="#1f6fb2")
        axes.set(title=title, xlabel="iteration")
    return figure
