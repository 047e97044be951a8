"""`gesture-bot train`: a refinement network for a gesture database."""

import argparse
import os
import sys
from importlib.util import find_spec

from gesture_bot.base.errors import InvalidValueError, TrainingError
from gesture_bot.corpus.demo import load_database
from gesture_bot.evaluate.held_out import distances

QUICK = {"iterations": 300, "width": 0.125, "batch": 16, "report_every": 20, "test_every": 100}
"""Proves the way from database to model within two minutes; the model is no good."""


def command(options: argparse.Namespace) -> int:
    """Train a refinement network, or go on with it; the exit status.

    Raises:
        GestureBotError: PyTorch is missing, an option is not valid, the training diverges, or a file cannot
            be read or written.
    """
    if missing := [name for name in ("torch", "onnx") if find_spec(name) is None]:
        raise TrainingError(f"{' and '.join(missing)} missing; try: pip install 'gesture-bot[train]'")
    from torch import cuda, distributed

    from gesture_bot.refine.training import Settings, Training

    chosen = {name: getattr(options, name) for name in ("iterations", "recipe", "width", "batch", "seed")}
    chosen |= QUICK if options.quick else {}
    iterations, settings = chosen.pop("iterations"), Settings(**chosen)
    for name, value in ("iterations", iterations), ("width", settings.width), ("batch", settings.batch):
        if not value > 0:
            raise InvalidValueError(f"number of --{name}", value, ["more than 0"])
    if options.output.suffix != ".onnx":
        raise InvalidValueError("kind of model file", options.output.name, [".onnx"])
    if "WORLD_SIZE" in os.environ:  # set by torchrun
        distributed.init_process_group("nccl" if cuda.is_available() else "gloo")
    database = load_database(options.database)
    spoken = load_database(options.speech) if options.speech else database
    training = Training(database, spoken, options.output, settings, distances)
    try:
        training.run(iterations)
    except KeyboardInterrupt:
        print(
            f"interrupted in iteration {training.iteration}; the same command goes on there", file=sys.stderr
        )
        raise
    if distributed.is_initialized():
        distributed.destroy_process_group()
    iteration, refined = training.best
    print(f"wrote {options.output}: the network of iteration {iteration}\nfrom the real motion held out:")
    for name, value in refined.items():
        print(f"  {name} {value:.3f}, of what the search found {training.rows[0][name]:.3f}")
    return 0
