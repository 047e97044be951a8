"""What `gesture-bot doctor` looks at.

Each check imports what it needs when it runs: a part that is missing is one finding, and hides no other.
"""

import grp
import importlib
import multiprocessing
import os
import platform
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from typing import Literal, NamedTuple

from gesture_bot.base.errors import BusError, DeviceError, FileFormatError
from gesture_bot.base.files import cache_dir
from gesture_bot.nodes.discovery import RANGE, keep_local
from gesture_bot.nodes.graph import NODES

PATIENCE = 10.0
"""Two processes that can talk by ROS do so within this time [s]."""

GIB = 2**30


class Finding(NamedTuple):
    """One line: `bad` keeps the package from working, `look` is worth a look, or only some need it."""

    check: str
    state: Literal["ok", "look", "bad"]
    found: str
    advice: str = ""


def look() -> Iterator[Finding]:
    """All findings, as the checks make them."""
    for check in CHECKS:
        try:
            yield from check()
        except Exception as error:  # whatever a broken installation says, the other checks go on
            found = " ".join(f"{type(error).__name__}: {error}".split())
            yield Finding(check.__name__.strip("_"), "bad", found, "install gesture_bot anew: README.md")


def _versions() -> Iterator[Finding]:
    try:
        ours = version("gesture-bot")
    except PackageNotFoundError:  # a ROS workspace does not list its packages for Python
        ours = "in a ROS workspace"
    yield Finding("gesture_bot", "ok", f"{ours}, {Path(__file__).parents[1]}")
    system = platform.freedesktop_os_release().get("PRETTY_NAME", platform.system())
    yield Finding("system", "ok", f"{system}, Linux {platform.release()}, {platform.machine()}")
    good = (3, 11) <= sys.version_info < (3, 14)
    advice = "" if good else "gesture_bot needs Python 3.11 to 3.13"
    yield Finding("Python", "ok" if good else "bad", f"{platform.python_version()}, {sys.executable}", advice)


def _compiler() -> Iterator[Finding]:
    found = [shutil.which(name) for name in ("cc", "c++")]
    if all(found):
        yield Finding("compiler", "ok", " and ".join(filter(None, found)))
    else:
        yield Finding("compiler", "look", "none", "only building needs it: sudo apt install build-essential")


def _processor() -> Iterator[Finding]:
    kernels = importlib.import_module("gesture_bot.matching.kernels")
    fast = kernels.call("has_avx2")
    found = f"{len(os.sched_getaffinity(0))} cores, {'with' if fast else 'without'} AVX2"
    yield Finding("processor", "ok", found, "" if fast else "a search in a large database takes longer")


def _memory() -> Iterator[Finding]:
    lines = Path("/proc/meminfo").read_text().splitlines()
    values = {name: int(rest.split()[0]) * 1024 / GIB for name, rest in (line.split(":") for line in lines)}
    total, free = values["MemTotal"], values["MemAvailable"]
    state: Literal["ok", "look"] = "ok" if free > 1.0 else "look"
    advice = (
        "" if state == "ok" else "the graph takes half a GB, with words recognised more: close other programs"
    )
    yield Finding("memory", state, f"{free:.1f} of {total:.1f} GB free", advice)


def _cache() -> Iterator[Finding]:
    try:
        folder = cache_dir()
        with tempfile.TemporaryFile(dir=folder):
            pass
    except (FileFormatError, OSError) as error:
        yield Finding("cache folder", "bad", str(error), "let this user write there, or set XDG_CACHE_HOME")
        return
    free = shutil.disk_usage(folder).free / GIB
    state: Literal["ok", "look"] = "ok" if free > 1.0 else "look"
    found, advice = f"{folder}, {free:.1f} GB free", "" if state == "ok" else "make room on this disk"
    yield Finding("cache folder", state, found, advice)


def _ros() -> Iterator[Finding]:
    before = os.environ.get(RANGE)
    keep_local()
    rclpy = importlib.import_module("rclpy")
    try:
        distribution = f"Jazzy, from wheels (rclpy {version('ros-jazzy-rclpy')})"
    except PackageNotFoundError:
        distribution = f"{os.environ.get('ROS_DISTRO', 'of an unknown distribution')}, {rclpy.__file__}"
    yield Finding("ROS 2", "ok", distribution)
    yield Finding("middleware", "ok", rclpy.get_rmw_implementation_identifier())

    domain = os.environ.get("ROS_DOMAIN_ID", "0")
    if not domain.isdecimal() or int(domain) > 232:
        yield Finding("domain", "bad", repr(domain), "set ROS_DOMAIN_ID to a number from 0 to 101")
        return
    if 101 < int(domain) < 215:
        advice = "other programs of Linux may take its ports: better a ROS_DOMAIN_ID from 0 to 101"
        yield Finding("domain", "look", domain, advice)
    else:
        yield Finding("domain", "ok", domain)
    yield _discovery(before)
    importlib.import_module("gesture_bot.msg")
    yield _traffic()


def _discovery(range_: str | None) -> Finding:
    match range_:
        case None:
            return Finding("discovery", "ok", f"this machine alone ({RANGE} is not set)")
        case "LOCALHOST":
            return Finding("discovery", "ok", "this machine alone")
        case "SUBNET" | "SYSTEM_DEFAULT":
            return Finding("discovery", "look", range_, "others may steer the robot: docs/security.md")
    advice = "no other program is heard: set it to LOCALHOST or SUBNET"
    return Finding("discovery", "bad", f"{RANGE}={range_}", advice)


def _traffic() -> Finding:
    """Do two processes hear each other; and does a graph run already."""
    from rclpy import Context, create_node, init, shutdown
    from rclpy.executors import SingleThreadedExecutor
    from std_msgs.msg import String

    topic, context = f"gesture_bot_doctor_{os.getpid()}", Context()
    heard: list[String] = []
    talker = multiprocessing.get_context("spawn").Process(target=_talk, args=(topic,), daemon=True)
    init(context=context)
    try:
        node = create_node(topic, context=context)
        node.create_subscription(String, topic, heard.append, 1)
        executor = SingleThreadedExecutor(context=context)
        executor.add_node(node)
        talker.start()
        give_up = time.monotonic() + PATIENCE
        while not heard and time.monotonic() < give_up:
            executor.spin_once(0.1)
        names = node.get_node_names()
        executor.shutdown()
    finally:
        talker.kill()
        shutdown(context=context)
    if not heard:
        advice = "does a firewall or a container stop UDP on the interface lo, or /dev/shm?"
        return Finding("traffic", "bad", f"two processes do not hear each other in {PATIENCE:g} s", advice)
    graphs = max(names.count(node.name) for node in NODES)
    if graphs > 1:
        advice = "both would move the robot: end one, or give it another ROS_DOMAIN_ID"
        return Finding("traffic", "look", f"{graphs} graphs run in this domain", advice)
    return Finding("traffic", "ok", "a graph is running" if graphs else "two processes hear each other")


def _talk(topic: str) -> None:
    import rclpy
    from std_msgs.msg import String

    rclpy.init()
    publisher = rclpy.create_node(f"{topic}_talker").create_publisher(String, topic, 1)
    while True:
        publisher.publish(String(data="hello"))
        time.sleep(0.05)


def _sound() -> Iterator[Finding]:
    devices = importlib.import_module("gesture_bot.speech.devices")
    for check, direction, without in (
        ("loudspeaker", "output", "the robot gestures in silence"),
        ("microphone", "input", "text, files and topics still work"),
    ):
        try:
            yield Finding(check, "ok", ", ".join(devices.device_names(direction)))
        except DeviceError as error:
            yield Finding(check, "look", str(error), without)


def _serial() -> Iterator[Finding]:
    from serial.tools.list_ports import comports

    from gesture_bot.servo.latency_timer import SHORTEST, latency
    from gesture_bot.servo.scan import find_ports

    try:
        find_ports()
    except BusError as error:
        yield Finding("serial port", "look", str(error), "only a real robot needs one")
    for port in sorted(comports()):
        if os.access(port.device, os.R_OK | os.W_OK):
            yield Finding("serial port", "ok", f"{port.device} ({port.product or 'of the board'})")
        else:
            usb = port.vid is not None  # a port of the board, which nobody may want, is no reason to fail
            found, advice = _permission(port.device)
            yield Finding("serial port", "bad" if usb else "look", found, advice)
        timer = latency(port.device)
        if timer is not None and timer > SHORTEST:
            advice = "set to 1 ms when gesture-bot opens the port; if not: docs/03-your-servos.md"
            yield Finding("latency timer", "look", f"{port.device} keeps answers back for {timer} ms", advice)


def _permission(port: str) -> tuple[str, str]:
    """Why a port cannot be opened, and what to do."""
    group = grp.getgrgid(os.stat(port).st_gid)
    user = os.environ.get("USER", "$USER")
    found = f"{port}: no permission; it belongs to the group {group.gr_name}"
    if group.gr_gid == 0:
        return found, "nobody should join that one: give the port to the group dialout, by a udev rule"
    if user in group.gr_mem:
        return found, f"{user} is in that group since the last login: log out and in again"
    return found, f"sudo usermod -aG {group.gr_name} {user}, then log out and in again"


def _extras() -> Iterator[Finding]:
    for check, modules, purpose in (
        ("training", ("torch", "onnx"), "to train a network: pip install '.[train]'"),
        ("espeak-ng", ("espeakng_loader",), "to speak other languages: pip install '.[espeak]'"),
        ("hri_msgs", ("hri_msgs",), "for robots of ROS4HRI: sudo apt install ros-$ROS_DISTRO-hri-msgs"),
        ("audio_common", ("audio_common_msgs",), "for microphone:=topic; from your ROS distribution"),
        ("ros2 command", ("ros2cli",), "to steer from a shell; examples/ do the same in Python"),
    ):
        missing = [module for module in modules if find_spec(module) is None]
        yield Finding(check, "ok", "not installed" if missing else "installed", purpose if missing else "")


CHECKS: tuple[Callable[[], Iterator[Finding]], ...] = (
    _versions, _compiler, _processor, _memory, _cache, _ros, _sound, _serial, _extras,
)  # fmt: skip
"""In the order of the table."""
