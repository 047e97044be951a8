"""From PyTorch to a model file, an ONNX graph with its card."""

import io
import warnings
from pathlib import Path
from typing import Any

import onnx
import torch

from gesture_bot.base.files import write_whole
from gesture_bot.corpus.database import SEQUENCE
from gesture_bot.refine.model import ENTRY, Card
from gesture_bot.refine.networks import CONTROLS, GESTURE, Generator
from gesture_bot.speech.features import FEATURES


def export(state: dict[str, Any], width: float, card: Card, path: Path) -> None:
    """Write a generator as a model file, whole or not at all.

    Args:
        state: Of the generator.
        width: Of the generator.
        card: What the file says about it.
        path: The file, .onnx.

    Raises:
        FileFormatError: It cannot be written.
    """
    generator = Generator(width, card.controls)
    generator.load_state_dict(state)
    generator.eval()
    heard = FEATURES + card.controls * CONTROLS
    example = torch.zeros(1, heard, SEQUENCE), torch.zeros(1, GESTURE, SEQUENCE)
    graph = io.BytesIO()
    with warnings.catch_warnings():
        # The new exporter would need another package, and writes the same graph.
        warnings.simplefilter("ignore", DeprecationWarning)
        warnings.filterwarnings("ignore", "Constant folding", UserWarning)
        torch.onnx.export(
            generator, example, graph, dynamo=False, opset_version=17,
            input_names=["heard", "found"], output_names=["refined"],
            dynamic_axes={name: {0: "windows"} for name in ("heard", "found", "refined")},
        )  # fmt: skip
    model = onnx.load_from_string(graph.getvalue())
    onnx.helper.set_model_props(model, {ENTRY: card.model_dump_json()})
    with write_whole(path) as temporary:
        onnx.save(model, temporary)
