"""Where files live, and how they are read with clear errors and written whole or not at all."""

import os
import re
import tempfile
from collections.abc import Hashable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import yaml
from platformdirs import user_cache_path, user_state_path
from pydantic import BaseModel, ValidationError

from gesture_bot.base.errors import FileFormatError

Model = TypeVar("Model", bound=BaseModel)

_PLAIN = {"missing": "is required", "extra_forbidden": "there is no such key"}
"""What stands for pydantic's words, by its type of error."""


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
    return _made(user_cache_path("gesture_bot"))


def state_dir() -> Path:
    """The folder for what must outlive a restart, on Linux $XDG_STATE_HOME/gesture_bot, made if need be.

    Raises:
        FileFormatError: It cannot be made.
    """
    return _made(user_state_path("gesture_bot"))


def _made(folder: Path) -> Path:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileFormatError(f"cannot make the folder {folder} ({error.strerror})") from error
    return folder


def read_yaml(path: Path, model: type[Model], context: dict[str, Any] | None = None) -> Model:
    """Read a YAML file into a pydantic model.

    Args:
        path: The file.
        model: What it should be.
        context: What the model's validators see as `info.context`.

    Raises:
        FileFormatError: The file is missing, is not YAML, or does not fit; then it names the line, the key
            and what is valid there.
    """
    text = read_text(path)
    try:
        return model.model_validate(yaml.load(text, _Loader), context=context)
    except yaml.YAMLError as error:
        raise FileFormatError(f"{path} is not YAML ({' '.join(str(error).split())})") from error
    except ValidationError as error:
        problems = (
            f"{yaml_place(path, one['loc'])}: "
            + _PLAIN.get(one["type"], one["msg"].removeprefix("Value error, "))
            + ("" if isinstance(one["input"], dict | list) else f" (got {one['input']!r:.80})")
            for one in error.errors()
        )
        raise FileFormatError(f"{path}: {'; '.join(problems)}") from error


def yaml_place(path: Path, location: Sequence[str | int]) -> str:
    """Where something is in a YAML file, for people: its line and dotted key.

    Args:
        path: The file.
        location: Keys and indices that lead to it; a part that the file lacks is at the line around it.
    """
    node, line = yaml.compose(read_text(path), _Loader), 1
    for part in location:
        inside: dict[str | int, tuple[yaml.Node, yaml.Node]] = {}
        if isinstance(node, yaml.MappingNode):
            inside = {key.value: (key, value) for key, value in node.value}
        elif isinstance(node, yaml.SequenceNode):
            inside = {index: (item, item) for index, item in enumerate(node.value)}
        if part in inside:
            key, node = inside[part]
            line = key.start_mark.line + 1
    return f"line {line}: {'.'.join(map(str, location)) or 'the file'}"


def read_text(path: Path) -> str:
    """What a text file holds.

    Raises:
        FileFormatError: It cannot be read.
    """
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise FileFormatError(f"cannot read {path} ({getattr(error, 'strerror', error)})") from error


class _Loader(yaml.SafeLoader):
    """YAML where a key that is there twice is an error, and yes, no, on and off are words."""

    yaml_implicit_resolvers = {
        letter: [(tag, pattern) for tag, pattern in resolvers if tag != "tag:yaml.org,2002:bool"]
        for letter, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        seen: list[object] = []
        for key, _ in node.value:
            if key.value in seen:
                raise yaml.constructor.ConstructorError(
                    problem=f"{key.value!r} is there twice", problem_mark=key.start_mark
                )
            seen.append(key.value)
        return super().construct_mapping(node, deep)


_Loader.add_implicit_resolver("tag:yaml.org,2002:bool", re.compile("(true|false)$"), ["t", "f"])


@contextmanager
def write_whole(path: Path) -> Iterator[Path]:
    """A temporary path that takes the place of `path` when the block ends well, and vanishes otherwise.

    Raises:
        FileFormatError: It cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=f".{path.stem}-", dir=path.parent) as folder:
            temporary = Path(folder) / path.name
            yield temporary
            with temporary.open("rb") as written:
                os.fsync(written.fileno())
            # Some libraries write for their own user alone; a robot's service has another.
            ordinary = Path(folder) / "ordinary"
            ordinary.touch()
            temporary.chmod(ordinary.stat().st_mode)
            os.replace(temporary, path)
    except OSError as error:
        raise FileFormatError(f"cannot write {path} ({error.strerror or error})") from error
