"""Training of the refinement network: the loop, its checkpoints, and the curves."""

import csv
import hashlib
import time
from collections import defaultdict
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from matplotlib.figure import Figure
from torch import distributed
from tqdm import tqdm

from gesture_bot.base.errors import FileFormatError, InvalidValueError, TrainingError
from gesture_bot.base.files import write_whole
from gesture_bot.corpus.database import Database
from gesture_bot.refine.export import export
from gesture_bot.refine.frechet import kinematic_distance
from gesture_bot.refine.gan import Gan
from gesture_bot.refine.model import Card
from gesture_bot.refine.pairs import Pairs, find_pairs, held_out

SAVE_EVERY = 60.0
"""Between checkpoints [s]."""

TESTED = 400
"""Windows that are held out and looked at, at most."""

LOSSES = ("distance", "penalty", "critic_gradient", "change", "generator_loss", "generator_gradient")


@dataclass(frozen=True)
class Settings:
    """What shapes a model, but for how long it is trained.

    Attributes:
        width: Share of the authors' channels.
        batch: Windows in a batch (MM22's code: 100); of each process, where there are several.
        seed: Of everything drawn at random.
        report_every: Iterations that a row of the curves sums up.
        test_every: Iterations from one look at what is held out to the next; a multiple of report_every.
    """

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
        database: To train on.
        output: The model file, .onnx.
        settings: See Settings.

    Attributes:
        iteration: The last one done.
        rows: The curves so far: a row every `report_every` iterations, with the means of the losses.

    Raises:
        InvalidValueError: There are too few recordings.
        FileFormatError: There is a checkpoint of another training.
    """

    def __init__(self, database: Database, output: Path, settings: Settings) -> None:
        self._database, self._output, self._settings = database, output, settings
        self.iteration, self.rows = 0, list[dict[str, float]]()
        self._best: dict[str, Any] = {"distance": np.inf, "iteration": 0, "generator": {}}
        saved = self._read_checkpoint()
        held = held_out(database, settings.seed)
        pairs, self._tested = find_pairs(database, held, settings.seed)
        self._tested = _thinned(self._tested)
        self._card = Card.of(database, pairs.real, asdict(settings))
        self._card.training["held_out"] = held.tolist()
        self._gan = Gan(
            np.ascontiguousarray(self._card.sound_in(database.features).T),
            np.ascontiguousarray(self._card.gesture_in(database.keypoints).T),
            pairs.real, pairs.found, settings.width, settings.batch, settings.seed,
        )  # fmt: skip
        if saved:
            self._gan.restore(saved["networks"])
            self.iteration, self.rows, self._best = saved["iteration"], saved["rows"], saved["best"]

    @property
    def results(self) -> tuple[int, float, float]:
        """The best generator's iteration, its distance from real motion, and that of the search alone."""
        return self._best["iteration"], self._best["distance"], self.rows[0]["held_out"]

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
            shown = {name: f"{self.rows[-1].get(name, np.nan):.3g}" for name in LOSSES[:2] + ("change",)}
            progress.set_postfix(shown, held_out=f"{self._best['distance']:.3g}", refresh=False)
            if time.monotonic() > saved + SAVE_EVERY or iteration == iterations:
                self._save()
                saved = time.monotonic()

    def _report(self, losses: dict[str, float], iteration: int, last: bool = False) -> None:
        """A row of the curves and, now and then, a look at the recordings that are held out."""
        self.rows.append({"iteration": iteration, **losses})
        if iteration % self._settings.test_every and not last:
            return
        # k = 1, as when the robot speaks.
        found = self._database.keypoints[self._tested.found[0]]
        made = self._card.gesture_out(self._gan.made(self._tested.found[0], self._tested.real), found)
        distance = kinematic_distance(self._database.keypoints[self._tested.real], made)
        self.rows[-1]["held_out"] = distance
        if iteration and distance < self._best["distance"]:
            generator = {
                name: value.cpu().clone() for name, value in self._gan.generator.state_dict().items()
            }
            self._best = {"distance": distance, "iteration": iteration, "generator": generator}

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
            writer = csv.DictWriter(file, ["iteration", *LOSSES, "held_out"])
            writer.writeheader()
            writer.writerows(self.rows)
        with write_whole(self._output.with_suffix(".png")) as temporary:
            _draw(self.rows).savefig(temporary)
        if self._best["iteration"]:
            self._card.training |= {
                "iteration": self._best["iteration"],
                "held_out_distance": self._best["distance"],
            }
            export(self._best["generator"], self._settings.width, self._card, self._output)

    def _identity(self) -> dict[str, Any]:
        """What a checkpoint must have in common with a training that goes on from it."""
        digest = hashlib.blake2b(digest_size=8)
        for array in (self._database.starts, self._database.keypoint_mean, self._database.feature_mean):
            digest.update(array.tobytes())
        return {"database": digest.hexdigest(), **asdict(self._settings)}

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


def _thinned(pairs: Pairs) -> Pairs:
    chosen = slice(None, None, -(-len(pairs.real) // TESTED))
    return Pairs(pairs.real[chosen], pairs.found[:, chosen])


def _first() -> bool:
    """Whether this process is the one that writes."""
    return not distributed.is_initialized() or distributed.get_rank() == 0


def _draw(rows: list[dict[str, float]]) -> Figure:
    figure = Figure((12, 3.5), layout="constrained")
    titles = {
        "distance": "critic: real over made",
        "penalty": "gradient penalty",
        "change": "change of the gesture [deviations]",
        "held_out": "held out: kinematic Frechet distance",
    }
    for axes, (name, title) in zip(figure.subplots(1, len(titles)), titles.items(), strict=True):
        known = [(row["iteration"], row[name]) for row in rows if name in row]
        axes.plot(*zip(*known, strict=True), color="#1f6fb2")
        axes.set(title=title, xlabel="iteration")
    return figure
