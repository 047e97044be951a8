"""Who may ask for motion, and what masks them: config/motion_mux.yaml, after twist_mux."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, model_validator

from gesture_bot.base.files import config_dir, read_yaml

NOBODY = "nobody"
STOP = "stop"

Priority = Annotated[int, Field(ge=0, le=255)]
Topic = Annotated[str, Field(pattern=r"^~?/?\w+(/\w+)*$")]


class _Entry(BaseModel):
    model_config = ConfigDict(extra="forbid")

    topic: Topic
    priority: Priority
    timeout: float = Field(math.inf, gt=0)


class _File(BaseModel):
    model_config = ConfigDict(extra="forbid")

    sources: dict[str, _Entry] = Field(min_length=1)
    locks: dict[str, _Entry] = {}

    @model_validator(mode="after")
    def _distinct(self) -> "_File":
        for name in (NOBODY, STOP):
            if name in self.sources:
                raise ValueError(f"{name!r} is no name for a source: it is who owns a joint without one")
        topics = [entry.topic for entry in (*self.sources.values(), *self.locks.values())]
        for topic in topics:
            if topics.count(topic) > 1:
                raise ValueError(f"the topic {topic!r} stands there twice")
        priorities = [entry.priority for entry in self.sources.values()]
        if len(set(priorities)) < len(priorities):
            raise ValueError(f"two sources must not have the same priority: {sorted(priorities)}")
        return self


@dataclass(frozen=True)
class Source:
    """Who may ask for motion.

    Attributes:
        name: Such as gesture or teleop.
        priority: The highest one that asks for a joint owns it.
        timeout: A joint is given back when its trajectory has ended and its last message is this old [s].
        topic: Where its trajectories come (trajectory_msgs/JointTrajectory).
    """

    name: str
    priority: int
    timeout: float = math.inf
    topic: str = ""


@dataclass(frozen=True)
class Lock:
    """What masks sources.

    Attributes:
        name: Such as teleop.
        priority: Sources of this priority and below are masked while it is engaged.
        timeout: When it has not been heard for so long, it is engaged [s]: its publisher has died.
        topic: Where it comes (std_msgs/Bool).
    """

    name: str
    priority: int
    timeout: float = math.inf
    topic: str = ""


def load_arbitration(file: str = "shipped") -> tuple[tuple[Source, ...], tuple[Lock, ...]]:
    """Sources and locks.

    Args:
        file: A YAML file, or "shipped".

    Raises:
        FileFormatError: It is missing or does not fit; names the line and what is valid there.
    """
    path = config_dir() / "motion_mux.yaml" if file == "shipped" else Path(file)
    read = read_yaml(path, _File)
    return (
        tuple(Source(name, row.priority, row.timeout, row.topic) for name, row in read.sources.items()),
        tuple(Lock(name, row.priority, row.timeout, row.topic) for name, row in read.locks.items()),
    )
