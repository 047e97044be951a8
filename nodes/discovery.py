"""Who can reach the graph, and who else moves the robot."""

import os
from typing import TYPE_CHECKING

from gesture_bot.base.errors import GestureBotError
from gesture_bot.base.files import config_dir

if TYPE_CHECKING:  # `gesture-bot doctor` runs where there is no rclpy
    from rclpy.node import Node

RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
PROFILES = "FASTRTPS_DEFAULT_PROFILES_FILE"

DISCOVERY = 1.0
"""So long it takes a new node to hear of others [s]."""


def keep_local() -> None:
    """Let nothing listen beyond this machine, unless the user has said how far ROS 2 may look for others."""
    if RANGE not in os.environ:
        os.environ[RANGE] = "LOCALHOST"
        # With that alone, Fast DDS looks for nobody else, but keeps its ports open on every interface.
        os.environ.setdefault(PROFILES, str(config_dir() / "local.xml"))


def movers(node: "Node") -> int:
    """How many programs publish what moves the robot, in a node's namespace."""
    return node.count_publishers(node.resolve_topic_name("joint_trajectory"))


def refuse_company(node: "Node", own: int = 0) -> None:
    """Let no second graph move the robot.

    Args:
        node: Looks for others, in its own namespace.
        own: How many of them belong to it.

    Raises:
        GestureBotError: There are more.
    """
    if movers(node) > own:
        message = "a graph is running already; end it, or use another ROS_DOMAIN_ID. It publishes"
        raise GestureBotError(message, node.resolve_topic_name("joint_trajectory"))
