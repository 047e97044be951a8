"""Where files live, and how they are read with clear errors and written whole or not at all."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

import yaml
from platformdirs import user_cache_path
from pydantic import BaseModel, ValidationError

from gesture_bot.base.errors import FileFormatError

Model = TypeVar("Model", bound=BaseModel)


def config_dir() -> Path:
    """The installed config/ folder: emotions.yaml, banks/, robots/."""
    for folder in Path(__file__).resolve().parents:
        for config in (folder / "config", folder / "share" / "gesture_bot" / "config"):
            if (config / "emotions.yaml").is_file():
                return config
    raise FileFormatError("the config folder is missing from the installation that holds", __file__)


def cache_dir() -> Path:
    """The folder for what is built on first use, on Linux $XDG_CACHE_HOME/gesture_bot, made if need be.

    Raises:
        FileFormatError: It cannot be made.
    """
    folder = user_cache_path("gesture_bot")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileFormatError(f"cannot make the cache folder {folder} ({error.strerror})") from error
    return folder


def read_yaml(path: Path, model: type[Model]) -> Model:
    """Read a YAML file into a pydantic model.

    Raises:
        FileFormatError: The file is missing, is not YAML, or does not fit; then it names the key and what is
            valid there.
    """
    try:
        text = path.read_text(encoding="utf-8")
        return model.model_validate(yaml.safe_load(text))
    except (OSError, UnicodeDecodeError) as error:
        raise FileFormatError(f"cannot read {path} ({getattr(error, 'strerror', error)})") from error
    except yaml.YAMLError as error:
        raise FileFormatError(f"{path} is not YAML ({' '.join(str(error).split())})") from error
    except ValidationError as error:
        problems = "; ".join(
            f"{'.'.join(map(str, one['loc'])) or 'the file'}: {one['msg']} (got {one['input']!r:.80})"
            for one in error.errors()
        )
        raise FileFormatError(f"{path}: {problems}") from error


@contextmanager
def write_whole(path: Path) -> Iterator[Path]:
    """A temporary path that takes the place of `path` when the block ends well, and vanishes otherwise."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f".{path.stem}-", dir=path.parent) as folder:
        temporary = Path(folder) / path.name
        yield temporary
        with temporary.open("rb") as written:
            os.fsync(written.fileno())
        os.replace(temporary, path)
