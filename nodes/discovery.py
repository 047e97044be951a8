"""Who can reach the graph."""

import os

from gesture_bot.base.files import config_dir

RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
PROFILES = "FASTRTPS_DEFAULT_PROFILES_FILE"


def keep_local() -> None:
    """Let nothing listen beyond this machine, unless the user has said how far ROS 2 may look for others."""
    if RANGE not in os.environ:
        os.environ[RANGE] = "LOCALHOST"
        # With that alone, Fast DDS looks for nobody else, but keeps its ports open on every interface.
        os.environ.setdefault(PROFILES, str(config_dir() / "local.xml"))
