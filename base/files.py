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
    raise FileFormatError("gesture_bot's config folder is missing from this installation", str(Path(__file__)))


def cache_dir() -> Path:
    """The folder for what is built on first use ($XDG_CACHE_HOME/gesture_bot), made if need be."""
    return user_cache_path("gesture_bot", ensure_exists=True)


def read_yaml(path: Path, model: type[Model]) -> Model:
    """Read a YAML file into a pydantic model.

    Raises:
        FileFormatError: The file is missing, is not YAML, or does not fit; names the key and what is valid there.
    """
    try:
        text = path.read_text(encoding="utf-8")
        return model.model_validate(yaml.safe_load(text))
    except (OSError, UnicodeDecodeError) as error:
        raise FileFormatError(f"cannot read {path} ({error})") from error
    except yaml.YAMLError as error:
        raise FileFormatError(f"{path} is not YAML ({' '.join(str(error).split())})") from error
    except ValidationError as error:
        problems = "; ".join(
            f"{'.'.join(map(str, problem['loc'])) or 'the file'}: {problem['msg']} (got {problem['input']!r:.80})"
            for problem in error.errors()
        )
        raise FileFormatError(f"{path}: {problems}") from error


@contextmanager
def write_whole(path: Path) -> Iterator[Path]:
    """A temporary path that takes the place of `path` when the block ends well, and vanishes when it does not."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f".{path.stem}-", dir=path.parent) as folder:
        temporary = Path(folder) / path.name
        yield temporary
        with temporary.open("rb") as written:
            os.fsync(written.fileno())
        os.replace(temporary, path)
