"""Keeps what passes on the topics in a file, without looking into the messages."""

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

from gesture_bot.base.errors import GestureBotError
from gesture_bot.recording.definitions import message_class, message_definition, type_hash
from gesture_bot.recording.writer import RecordingWriter

DEPTH = 1000
"""Messages of a topic that may wait while the disk is busy."""


@dataclass
class _Topic:
    type_name: str
    subscription: Subscription
    request: tuple[ReliabilityPolicy, DurabilityPolicy]
    channel: int | None = None
    published: int = 0


class BagRecorder(Node):
    """Subscribes to every topic that it finds. It is not spun: its owner calls `look_around` and `drain`.

    An executor would wake for each message. Taking all that has come, 20 times a second, costs a fraction of
    that, and each message has the moment of its arrival from the middleware.

    Args:
        path: File to write, ending in .mcap.
        topics: Topics to record; none: all but hidden ones.
        overwrite: Whether a file that is there may be lost.

    Raises:
        InvalidValueError: The file is there already, or its name does not end in .mcap.
        FileFormatError: It cannot be written.
    """

    def __init__(self, path: Path, topics: Collection[str] = (), overwrite: bool = False, **options: Any):
        self._writer = RecordingWriter(path, overwrite)
        super().__init__("bag_recorder", enable_rosout=False, start_parameter_services=False, **options)
        self._wanted = {self.resolve_topic_name(topic) for topic in topics}
        self._topics: dict[str, _Topic] = {}
        self._left_out: set[str] = set()

    @property
    def messages(self) -> int:
        """How many have been written."""
        return self._writer.messages

    @property
    def missing(self) -> set[str]:
        """Topics that were named, and of which nothing has been heard."""
        return {name for name in self._wanted if name not in self._topics or not self._topics[name].published}

    def look_around(self) -> None:
        """Subscribe to what is new, and bring everything so far to the disk."""
        for name, types in self.get_topic_names_and_types():
            hidden = any(part.startswith("_") for part in name.split("/"))
            wanted = name in self._wanted if self._wanted else not hidden
            if wanted and name not in self._left_out:
                self._follow(name, types[0])
        self._writer.flush()

    def drain(self) -> None:
        """Write all that has come."""
        for name, topic in self._topics.items():
            handle = topic.subscription.handle
            with handle:
                while taken := handle.take_message(topic.subscription.msg_type, True):
                    self._write(name, topic, *taken)

    def destroy_node(self) -> None:
        """Write what has come, and close the file."""
        self.drain()
        self._writer.close()
        super().destroy_node()

    def _write(self, name: str, topic: _Topic, data: bytes, info: dict[str, int]) -> None:
        published = info["source_timestamp"]
        if published == topic.published:
            return  # a latched message, heard again by a new subscription
        topic.published = published
        if topic.channel is None:
            offered = [_in_words(offer.qos_profile) for offer in self.get_publishers_info_by_topic(name)]
            topic.channel = self._writer.add_topic(name, topic.type_name, offered)
        self._writer.write(topic.channel, info["received_timestamp"], published, data)

    def _follow(self, name: str, type_name: str) -> None:
        known = self._topics.get(name)
        request = self._request(name)
        if not request or (known and known.request == request):
            return
        try:
            message_type = message_class(type_name)
            message_definition(type_name), type_hash(type_name)  # all that the file is to hold
        except GestureBotError as error:
            self.get_logger().warning(f"{name} is left out: {error}")
            self._left_out.add(name)
            return
        qos = QoSProfile(depth=DEPTH, reliability=request[0], durability=request[1])
        subscription = self.create_subscription(message_type, name, lambda _: None, qos, raw=True)
        if known:
            self.destroy_subscription(known.subscription)
            known.subscription, known.request = subscription, request
        else:
            self._topics[name] = _Topic(type_name, subscription, request)

    def _request(self, name: str) -> tuple[ReliabilityPolicy, DurabilityPolicy] | None:
        """The most that all publishers offer, as rosbag2 asks for; None where nobody else is there.

        Before a publisher comes it is what all subscribers can hear, so that its first message is kept.
        """
        offers = [offer.qos_profile for offer in self.get_publishers_info_by_topic(name)]
        latched = bool(offers) and all(
            offer.durability == DurabilityPolicy.TRANSIENT_LOCAL for offer in offers
        )
        profiles = offers or [
            info.qos_profile
            for info in self.get_subscriptions_info_by_topic(name)
            if info.node_name != self.get_name()
        ]
        if not profiles:
            return None
        reliable = all(profile.reliability == ReliabilityPolicy.RELIABLE for profile in profiles)
        return (
            ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
            DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
        )


def _in_words(qos: QoSProfile) -> dict[str, object]:
    """A QoS profile as rosbag2 writes it since version 9 of its metadata."""
    return {
        "history": qos.history.name.lower(),
        "depth": qos.depth,
        "reliability": qos.reliability.name.lower(),
        "durability": qos.durability.name.lower(),
        "deadline": _parts(qos.deadline),
        "lifespan": _parts(qos.lifespan),
        "liveliness": qos.liveliness.name.lower(),
        "liveliness_lease_duration": _parts(qos.liveliness_lease_duration),
        "avoid_ros_namespace_conventions": qos.avoid_ros_namespace_conventions,
    }


def _parts(duration: Duration) -> dict[str, int]:
    sec, nsec = divmod(duration.nanoseconds, 10**9)
    return {"sec": sec, "nsec": nsec}
