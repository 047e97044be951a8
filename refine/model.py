"""A trained refinement network in its file, run by ONNX Runtime."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, Self

import numpy as np
import onnxruntime
from pydantic import BaseModel, ConfigDict, ValidationError

from gesture_bot.base.errors import FileFormatError
from gesture_bot.base.files import config_dir
from gesture_bot.base.frames import FRAME_RATE
from gesture_bot.base.keypoints import (
    BONES,
    KEYPOINTS,
    bone_lengths,
    bone_vectors,
    from_bone_vectors,
    with_bone_lengths,
)
from gesture_bot.corpus.database import Database
from gesture_bot.refine.bounds import measured

ENTRY = "gesture_bot model"
"""Of the ONNX file's metadata; it holds a Card as JSON."""

VERSION = 2
"""Of the format."""

SHIPPED, NONE = "shipped", "none"
"""Names of networks that are no files."""

FARTHEST = 0.1
"""The database of a model and the one in use may differ so much in mean and deviation [deviations].

The demo corpus, built again on another machine, differs in the last bits alone.
"""

Network = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""(w, 28, 64) sound, or (w, 60, 64) sound and controls, and (w, 48, 64) gesture found -> (w, 48, 64) gesture.

All float32 and z-scored.
"""

LEAST_DEVIATION = 1e-3
"""A number that hardly changes counts as changing so much; hips are at rest in the pelvis frame [m]."""


class Card(BaseModel):
    """What a model file says about itself.

    Attributes:
        version: Of the format.
        skeleton: Names of the keypoints.
        frame_rate: [Hz].
        keypoint_mean, keypoint_deviation: (17, 3) of the database that it was trained on [m].
        feature_mean, feature_deviation: (28,) of that database; z-scores the sound.
        bone_mean, bone_deviation: (16, 3) of the bones' vectors; z-scores the gesture [m].
        quantity_mean, quantity_deviation: (8,) of what the controls bound; z-scores their thresholds.
        controls: Whether the network sees the controls.
        provenance: Where that database and the recordings come from: their metadata.
        settings: With which it was trained.
        training: How far it was, and how good it was then.
    """

    model_config = ConfigDict(extra="forbid")

    version: int = VERSION
    skeleton: tuple[str, ...] = KEYPOINTS
    frame_rate: int = FRAME_RATE
    keypoint_mean: list[list[float]]
    keypoint_deviation: list[list[float]]
    feature_mean: list[float]
    feature_deviation: list[float]
    bone_mean: list[list[float]]
    bone_deviation: list[list[float]]
    quantity_mean: list[float]
    quantity_deviation: list[float]
    controls: bool
    provenance: dict[str, Any]
    settings: dict[str, Any]
    training: dict[str, Any]

    @classmethod
    def of(
        cls, database: Database, spoken: Database, rows: np.ndarray, controls: bool, settings: dict[str, Any]
    ) -> Self:
        """The card of a model for a database that is to be trained on rows of recordings."""
        rows = np.unique(rows)
        bones = bone_vectors(spoken.keypoints[rows].astype(np.float64))
        quantities = measured(spoken)[rows].astype(np.float64)
        return cls(
            keypoint_mean=database.keypoint_mean.tolist(),
            keypoint_deviation=database.keypoint_deviation.tolist(),
            feature_mean=database.feature_mean.tolist(),
            feature_deviation=database.feature_deviation.tolist(),
            bone_mean=bones.mean(axis=0).tolist(),
            bone_deviation=np.maximum(bones.std(axis=0), LEAST_DEVIATION).tolist(),
            quantity_mean=quantities.mean(axis=0).tolist(),
            quantity_deviation=np.maximum(quantities.std(axis=0), LEAST_DEVIATION).tolist(),
            controls=controls,
            provenance={"database": database.metadata, "spoken": spoken.metadata},
            settings=settings,
            training={},
        )

    def heard_in(self, features: np.ndarray, bounds: np.ndarray) -> np.ndarray:
        """Sound and controls as the network takes them.

        Args:
            features: (..., t, 28) speech features.
            bounds: (..., t, 16) thresholds; see bounds.bounds_of.

        Returns:
            (..., 28, t) float32 or, where the network sees controls, (..., 60, t): then come each bound's
            target and mask.
        """
        parts = [(features - np.array(self.feature_mean)) / np.array(self.feature_deviation)]
        if self.controls:
            mask = np.isfinite(bounds)
            scored = (bounds - np.tile(self.quantity_mean, 2)) / np.tile(self.quantity_deviation, 2)
            parts += [np.where(mask, scored, 0), mask]
        return np.ascontiguousarray(np.swapaxes(np.concatenate(parts, axis=-1), -1, -2), np.float32)

    def gesture_in(self, keypoints: np.ndarray) -> np.ndarray:
        """Keypoints (..., t, 17, 3) [m] as the network takes them: (..., 48, t) float32."""
        scored = (bone_vectors(keypoints) - np.array(self.bone_mean)) / np.array(self.bone_deviation)
        return np.ascontiguousarray(np.swapaxes(scored.reshape(*scored.shape[:-2], -1), -1, -2), np.float32)

    def refined(
        self, run: Network, features: np.ndarray, keypoints: np.ndarray, bounds: np.ndarray
    ) -> np.ndarray:
        """Gestures that go with the sound, from those that the search found for it.

        Args:
            run: The network.
            features: (w, 64, 28) speech features of windows.
            keypoints: (w, 64, 17, 3) what was found, joined [m], pelvis frame.
            bounds: (w, 64, 16) thresholds that the search kept for it; see bounds.bounds_of.

        Returns:
            (w, 64, 17, 3) [m], with the pelvis and the bone lengths of `keypoints`.
        """
        made = np.swapaxes(run(self.heard_in(features, bounds), self.gesture_in(keypoints)), -1, -2)
        vectors = made.reshape(*made.shape[:-1], len(BONES), 3) * np.array(self.bone_deviation)
        refined = from_bone_vectors(vectors + np.array(self.bone_mean)) + keypoints[..., :1, :]
        return with_bone_lengths(refined, bone_lengths(keypoints))

    def check(self, database: Database) -> None:
        """Raise a FileFormatError with the reason where the model was not trained for a database."""
        for name in ("keypoint", "feature"):
            trained, here = (
                (np.asarray(getattr(one, f"{name}_mean")), np.asarray(getattr(one, f"{name}_deviation")))
                for one in (self, database)
            )
            apart = np.abs(trained[0] - here[0]) / trained[1], np.abs(here[1] / trained[1] - 1)
            for what, distances in zip(("mean", "deviation"), apart, strict=True):
                place = np.unravel_index(distances.argmax(), distances.shape)
                if not distances[place] <= FARTHEST:
                    which = f"{KEYPOINTS[place[0]]} {'xyz'[place[1]]}" if name == "keypoint" else place[0]
                    other = self.provenance["database"].get("provenance")
                    raise FileFormatError(
                        f"the model was trained for another database ({other}): "
                        f"the {what} of {name} {which} differs by {distances[place]:.2g} deviations"
                    )


class RefinementModel:
    """A network that is ready to run, on one thread.

    Attributes:
        card: What it says about itself.
    """

    def __init__(self, path: Path) -> None:
        """Open a model file.

        Raises:
            FileFormatError: It cannot be read, or is no model of this package, version and skeleton.
        """
        if not path.is_file():
            raise FileFormatError(f"cannot read {path} as a model (there is no such file)")
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.log_severity_level = 3
        try:
            self._session = onnxruntime.InferenceSession(path, options, ["CPUExecutionProvider"])
        except Exception as error:  # ONNX Runtime has a class of its own for every kind of damage
            raise FileFormatError(
                f"cannot read {path} as a model ({' '.join(str(error).split())})"
            ) from error
        entry = self._session.get_modelmeta().custom_metadata_map.get(ENTRY)
        if entry is None:
            raise FileFormatError(f"{path} is an ONNX file, but no {ENTRY}")
        try:
            self.card = Card.model_validate_json(entry)
        except ValidationError as error:
            raise FileFormatError(f"{path} was written by another version: {error}") from error
        for key, valid in ("version", VERSION), ("skeleton", KEYPOINTS), ("frame_rate", FRAME_RATE):
            if getattr(self.card, key) != valid:
                raise FileFormatError(f"{path}: {key} of the model", getattr(self.card, key), [valid])

    def refined(self, features: np.ndarray, keypoints: np.ndarray, bounds: np.ndarray) -> np.ndarray:
        """Gestures that go with the sound and keep to the bounds; see Card.refined."""
        return self.card.refined(self.run, features, keypoints, bounds)

    def run(self, heard: np.ndarray, found: np.ndarray) -> np.ndarray:
        """The network alone; see Network."""
        return self._session.run(None, {"heard": heard, "found": found})[0]


def load_model(name: str, database: Database) -> RefinementModel | None:
    """The network for a database.

    Args:
        name: A file; SHIPPED, the network of the demo corpus, where it fits; or NONE.
        database: What it is to refine.

    Returns:
        The network, or None where there is none to use.

    Raises:
        FileFormatError: See RefinementModel and Card.check.
    """
    if name == NONE:
        return None
    model = RefinementModel(
        config_dir() / "models" / "gesture_refiner.onnx" if name == SHIPPED else Path(name)
    )
    try:
        model.card.check(database)
    except FileFormatError:
        if name == SHIPPED:
            return None
        raise
    return model
