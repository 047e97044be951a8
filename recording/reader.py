"""Reads a recording, also one whose end is missing."""

import os
import struct
import zlib
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import zstandard
from mcap.exceptions import McapError
from mcap.reader import SeekingReader
from mcap.records import Channel, DataEnd, Message, Schema
from mcap.stream_reader import StreamReader

from gesture_bot.base.errors import FileFormatError, InvalidValueError
from gesture_bot.recording.definitions import type_hash

_BROKEN = (
    McapError, ValueError, KeyError, OverflowError, MemoryError, RuntimeError, struct.error,
    zstandard.ZstdError,
)  # fmt: skip
"""What reading a file raises that ends in the middle, is damaged, or is no MCAP."""

FOOTER = 28
"""From the footer's content to the end of a file, whose last 8 bytes are its magic [bytes]."""

_Entry = tuple[Any, Any, Any]
"""Schema, channel and message, as mcap reads them."""

_GRAPH = (
    "gesture/joint_trajectory",
    "teleop/joint_trajectory",
    "joint_trajectory",
    "joint_states",
    "gesture/refined",
    "speech/audio",
)
"""Topics that tell the namespace of the graph; one that ends as another does comes before it."""


@dataclass(frozen=True)
class Recorded:
    """A message in CDR.

    Attributes:
        topic: Its full name.
        type_name: Such as `sensor_msgs/msg/JointState`.
        received: When it arrived [ns since the epoch].
        data: The message.
    """

    topic: str
    type_name: str
    received: int
    data: bytes


class Recording:
    """An MCAP file with ROS 2 messages, of `gesture-bot record` or `ros2 bag record -s mcap`.

    A file that was not closed is read as far as it is whole, and kept in memory.

    Args:
        path: The file.

    Attributes:
        path: The file.
        topics: The type of each topic, by its full name.
        begin: When its first message arrived [ns since the epoch].
        end: When its last message arrived [ns since the epoch].

    Raises:
        FileFormatError: It cannot be read, is no MCAP of ROS 2, or holds no message.
    """

    def __init__(self, path: Path):
        self.path = path
        self._salvaged: list[_Entry] | None = None
        try:
            with path.open("rb") as file:
                self._open(file)
        except OSError as error:
            raise FileFormatError(f"cannot read {path} ({error.strerror or error})") from error
        if not self.topics:
            raise FileFormatError("the recording holds no message", str(path))

    @property
    def cut_off(self) -> bool:
        """Whether the file's end is missing."""
        return self._salvaged is not None

    @property
    def duration(self) -> float:
        """From the first message to the last [s]."""
        return (self.end - self.begin) * 1e-9

    def topic(self, name: str) -> str:
        """The full name of one of the graph's topics, whatever its namespace was.

        Raises:
            InvalidValueError: No graph was recorded, or several.
        """
        namespaces = set()
        for topic in self.topics:
            if ending := next((f"/{known}" for known in _GRAPH if topic.endswith(f"/{known}")), ""):
                namespaces.add(topic.removesuffix(ending))
        if len(namespaces) != 1:
            found = f"graphs in {len(namespaces)} namespaces" if namespaces else "no topic of a graph"
            raise InvalidValueError(f"{self.path} holds {found}; its topics: {', '.join(self.topics)}")
        return f"{namespaces.pop()}/{name}"

    def messages(self, *topics: str) -> Iterator[Recorded]:
        """The messages of some topics, of all if none is named, in the order of their arrival.

        Raises:
            FileFormatError: A type of theirs is not installed, or another version of it is, or the file is
                damaged.
        """
        for topic in topics or self.topics:
            self._check_type(topic)
        if self._salvaged is not None:
            yield from (
                _recorded(entry) for entry in self._salvaged if not topics or entry[1].topic in topics
            )
            return
        with self.path.open("rb") as file:
            try:
                reader = SeekingReader(file, validate_crcs=True)
                yield from map(_recorded, reader.iter_messages(topics or None))
            except _BROKEN as error:
                message = "the recording is damaged; `mcap recover` saves what it can"
                raise FileFormatError(message, str(self.path)) from error

    def _open(self, file: IO[bytes]) -> None:
        try:
            reader = SeekingReader(file)
            profile = reader.get_header().profile
        except _BROKEN as error:
            raise FileFormatError("this is no MCAP file", str(self.path)) from error
        if profile != "ros2":
            raise FileFormatError(f"{self.path} is an MCAP file of another profile than ros2", profile)
        try:
            summary = reader.get_summary() if _index_is_whole(file) else None
        except _BROKEN:
            summary = None
        if summary and summary.statistics:
            types = {number: schema.name for number, schema in summary.schemas.items()}
            channels = list(summary.channels.values())
            self.begin = summary.statistics.message_start_time
            self.end = summary.statistics.message_end_time
        else:
            file.seek(0)
            self._salvaged = sorted(_whole(file), key=lambda entry: entry[2].log_time)
            types = {schema.id: schema.name for schema, _, _ in self._salvaged}
            channels = list({channel.id: channel for _, channel, _ in self._salvaged}.values())
            if self._salvaged:
                self.begin, self.end = self._salvaged[0][2].log_time, self._salvaged[-1][2].log_time
        self.topics = {channel.topic: types[channel.schema_id] for channel in channels}
        self._hashes = {channel.topic: channel.metadata.get("topic_type_hash") for channel in channels}

    def _check_type(self, topic: str) -> None:
        if topic not in self.topics:
            return
        recorded, name = self._hashes[topic], self.topics[topic]
        if recorded and recorded != type_hash(name):
            raise FileFormatError(f"{topic} was recorded with another version of the message type", name)


def _index_is_whole(file: IO[bytes]) -> bool:
    """Whether the index at the end matches its checksum; one of 0 is none (MCAP specification, Footer)."""
    footer = file.seek(0, os.SEEK_END) - FOOTER
    file.seek(max(0, footer))
    start, _, checksum = struct.unpack("<QQI", file.read(20))
    if start > footer:
        return False
    file.seek(start)
    return checksum == 0 or zlib.crc32(file.read()[: 16 - FOOTER]) == checksum


def _whole(file: IO[bytes]) -> Iterator[_Entry]:
    """Messages of the chunks that are whole, up to where the file breaks off, or its index begins."""
    schemas, channels = dict[int, Schema](), dict[int, Channel]()
    with suppress(*_BROKEN):
        for record in StreamReader(file, validate_crcs=True).records:
            match record:
                case Schema():
                    schemas[record.id] = record
                case Channel():
                    channels[record.id] = record
                case Message():
                    channel = channels[record.channel_id]
                    yield schemas[channel.schema_id], channel, record
                case DataEnd():
                    break


def _recorded(entry: _Entry) -> Recorded:
    schema, channel, message = entry
    return Recorded(channel.topic, schema.name, message.log_time, message.data)
