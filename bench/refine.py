"""How long the refinement network takes for a window, beside the same network in PyTorch.

`make bench-refine`; one thread for both; the last line is one JSON object.
"""

import json
import time
from collections.abc import Callable
from statistics import median

import numpy as np
import onnxruntime
import torch
from machine import machine

from gesture_bot.base.frames import WINDOW, KeypointClip
from gesture_bot.corpus.database import SEQUENCE
from gesture_bot.corpus.demo import load_database
from gesture_bot.matching.hearing import Hearing
from gesture_bot.refine.model import SHIPPED, load_model
from gesture_bot.refine.networks import CONTROLS, GESTURE, Generator
from gesture_bot.refine.streaming import NetworkRefiner
from gesture_bot.speech.features import FEATURES

ROUNDS = 300


def timed(call: Callable[[], object]) -> float:
    """How long it takes [ms]."""
    begin = time.perf_counter()
    call()
    return 1e3 * (time.perf_counter() - begin)


def main() -> None:
    """Time both in turn, and a whole step of the refiner, from a window to what is sent on."""
    torch.set_num_threads(1)
    database = load_database("demo")
    model = load_model(SHIPPED, database)
    assert model
    random = np.random.default_rng(0)
    heard, found = (
        random.normal(size=(1, numbers, SEQUENCE)).astype(np.float32)
        for numbers in (FEATURES + model.card.controls * CONTROLS, GESTURE)
    )
    width = model.card.settings["width"]
    generator, inputs = Generator(width, model.card.controls).eval(), [*map(torch.from_numpy, (heard, found))]
    refiner = NetworkRefiner(model, Hearing(database))
    ours, rival, step = [], [], []
    for number in range(ROUNDS):
        ours.append(timed(lambda: model.run(heard, found)))
        with torch.inference_mode():
            rival.append(timed(lambda: generator(*inputs)))
        window = KeypointClip(WINDOW * number, database.keypoints[WINDOW * number :][:WINDOW])
        step.append(timed(lambda: refiner.push(window, "speech")))  # noqa: B023  called at once
    figures = {
        "width": width,
        "onnx_runtime_ms": median(ours),
        "torch_ms": median(rival),
        "ratio": median(rival) / median(ours),
        "step_ms": median(step),
        "step_ms_p99": float(np.percentile(step, 99)),
        "onnxruntime": onnxruntime.__version__,
        "torch": torch.__version__,
        **machine(),
    }
    for name, value in figures.items():
        print(f"{name:18} {value:.2f}" if isinstance(value, float) else f"{name:18} {value}")
    print(json.dumps(figures))


if __name__ == "__main__":
    main()
