"""Who can reach a running node: nobody beyond this machine, unless asked."""

import sysconfig
from pathlib import Path

import psutil
import pytest
from conftest import running, wait_until

pytestmark = pytest.mark.live

REFINER = Path(sysconfig.get_path("data")) / "lib" / "gesture_bot" / "gesture_refiner"
EPHEMERAL = int(Path("/proc/sys/net/ipv4/ip_local_port_range").read_text().split()[0])
"""From this port on are those that a socket gets for sending; nobody knows them."""


def listens_at(process):
    sockets = psutil.Process(process.pid).net_connections("inet")
    return {socket.laddr.ip for socket in sockets if socket.laddr.port < EPHEMERAL}


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        ({}, {"127.0.0.1"}),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}, {"0.0.0.0"}),
        ({"AMENT_PREFIX_PATH": sysconfig.get_path("data")}, {"0.0.0.0"}),
    ],
    ids=["by default", "opened", "in an environment of ROS 2"],
)
def test_a_node_listens_on_this_machine_alone_unless_asked(listener, monkeypatch, settings, expected):
    monkeypatch.delenv("ROS_AUTOMATIC_DISCOVERY_RANGE")
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)
    for name, value in settings.items():
        monkeypatch.setenv(name, value)
    with running([str(REFINER)]) as process:
        # The listener is in a process with settings of its own.
        wait_until(lambda: "gesture_refiner" in listener.get_node_names(), 30, "the node")
        assert listens_at(process) == expected
