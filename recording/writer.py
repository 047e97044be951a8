"""Writes a recording, so that a crash costs its last second at most."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import yaml
from mcap.writer import Writer

from gesture_bot.base.errors import FileFormatError, InvalidValueError
from gesture_bot.recording.definitions import message_definition, type_hash


class RecordingWriter:
    """An MCAP file with profile ros2: CDR messages, their ros2msg definitions, and each topic's offered QoS.

    Args:
        path: File to write, ending in .mcap.
        overwrite: Whether a file that is there may be lost.

    Attributes:
        messages: How many have been written.

    Raises:
        InvalidValueError: The file is there already, or its name does not end in .mcap.
        FileFormatError: It cannot be written.
    """

    def __init__(self, path: Path, overwrite: bool = False):
        if path.suffix != ".mcap":
            raise InvalidValueError("a recording is a file of this kind", path.name, [".mcap"])
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = path.open("wb" if overwrite else "xb")
        except FileExistsError as error:
            raise InvalidValueError(
                "the recording is there already; --overwrite drops it", str(path)
            ) from error
        except OSError as error:
            raise FileFormatError(f"cannot write {path} ({error.strerror})") from error
        self.messages = 0
        self._schemas: dict[str, int] = {}
        self._writer = Writer(self._file)
        self._writer.start(profile="ros2")
        self.flush()

    def add_topic(self, topic: str, type_name: str, offered_qos: list[dict[str, object]]) -> int:
        """The channel of a new topic.

        Args:
            topic: Its full name.
            type_name: Such as `sensor_msgs/msg/JointState`.
            offered_qos: QoS of each of its publishers, in the words of rosbag2's metadata version 9.

        Raises:
            FileFormatError: The type is not installed.
        """
        if type_name not in self._schemas:
            definition = message_definition(type_name).encode()
            self._schemas[type_name] = self._writer.register_schema(type_name, "ros2msg", definition)
        metadata = {
            "offered_qos_profiles": yaml.safe_dump(offered_qos, sort_keys=False),
            "topic_type_hash": type_hash(type_name),
        }
        return self._writer.register_channel(topic, "cdr", self._schemas[type_name], metadata)

    def write(self, channel: int, received: int, published: int, data: bytes) -> None:
        """Add a message.

        Args:
            channel: Of its topic.
            received: When it arrived [ns since the epoch].
            published: When it was sent [ns since the epoch].
            data: The message in CDR.

        Raises:
            FileFormatError: The disk does not take it.
        """
        with self._disk():
            self._writer.add_message(channel, received, data, published)
        self.messages += 1

    def flush(self) -> None:
        """Bring all to the disk, in whole chunks, which readers find even without the file's end."""
        with self._disk():
            self._writer.flush()
            os.fsync(self._file.fileno())

    def close(self) -> None:
        """Write the index, and close the file."""
        with self._disk():
            self._writer.finish()
            self._file.close()

    @contextmanager
    def _disk(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise FileFormatError(f"cannot write {self._file.name} ({error.strerror})") from error
