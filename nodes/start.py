"""Starts one node in a process of its own, or the whole graph in one process."""

import importlib
import json
import os
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from itertools import pairwise
from pathlib import Path

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions, install_signal_handlers, uninstall_signal_handlers

from gesture_bot.base.errors import GestureBotError, InvalidValueError
from gesture_bot.base.files import config_dir
from gesture_bot.nodes.discovery import keep_local
from gesture_bot.nodes.graph import ARGUMENTS, COMMON, NODES, Argument, GraphNode
from gesture_bot.nodes.interruption import Interruption
from gesture_bot.nodes.managed import ManagedNode
from gesture_bot.nodes.node import until_shutdown
from gesture_bot.nodes.parameter_file import check_file, check_parameters

PATIENCE = 3.0
"""A node beside the others has so long to end [s]."""


def start_node(name: str) -> int:
    """Run one node with the command line's ROS arguments until it is told to stop; the exit status."""
    if "AMENT_PREFIX_PATH" not in os.environ:  # no ROS 2 environment, whose settings are the user's own
        keep_local()
    return _spin([node for node in NODES if node.name == name], {}, sys.argv)


def run_graph(arguments: Sequence[str]) -> int:
    """Run every node in this process until it is told to stop, but for those that have a switch.

    Args:
        arguments: NAME:=VALUE strings, the same names that the launch file takes.

    Returns:
        The exit status: 0, or 1 after an error, which is printed in one line.
    """
    keep_local()
    try:
        values = parse_arguments(arguments)
        settings = _settings(values)
    except GestureBotError as error:
        return _report(error)
    with ExitStack() as beside:
        for node in NODES:
            if node.switch and values.get(node.switch) == "true":
                beside.enter_context(_process(node, values, settings))
        return _spin([node for node in NODES if not node.switch], values, settings)


def parse_arguments(
    arguments: Sequence[str], valid: Sequence[Argument] = (*ARGUMENTS, *COMMON)
) -> dict[str, str | int]:
    """The values of NAME:=VALUE strings, each of its argument's type.

    Raises:
        InvalidValueError: Not NAME:=VALUE, an unknown name, a value of another type, or a switch that is
            neither true nor false.
    """
    known = {argument.name: argument for argument in valid}
    values: dict[str, str | int] = {}
    for text in arguments:
        name, separator, value = text.partition(":=")
        if not separator:
            raise InvalidValueError("an argument is written NAME:=VALUE", text, known)
        if name not in known:
            raise InvalidValueError("unknown argument", name, known)
        if any(node.switch == name for node in NODES) and value not in ("true", "false"):
            raise InvalidValueError(f"argument {name}", value, ["true", "false"])
        try:
            values[name] = type(known[name].default)(value)
        except ValueError:
            raise InvalidValueError(f"argument {name} takes a whole number", value) from None
    return values


def _settings(values: Mapping[str, str | int]) -> list[str]:
    """The ROS arguments that give the nodes of this package their parameters.

    Raises:
        FileFormatError: The user's file of parameters is none.
    """
    files = [str(config_dir() / "gesture_bot.yaml")]
    if given := str(values.get("parameters", "")):
        check_file(Path(given))
        files.append(given)  # what is set twice is as in the last one
    return ["--ros-args", *(word for file in files for word in ("--params-file", file))]


@contextmanager
def _process(node: GraphNode, values: Mapping[str, str | int], settings: Sequence[str]) -> Iterator[None]:
    """A node in a process of its own, which ends with this one, however that ends: it reads from a pipe."""
    given = [f"{name}:={json.dumps(values[name])}" for name in node.arguments if name in values]
    command = [sys.executable, "-m", __name__, node.name, *settings]
    command += [argument for value in given for argument in ("-p", value)]
    if values.get("namespace"):
        command += ["-r", f"__ns:=/{str(values['namespace']).strip('/')}"]
    # In a session of its own, Ctrl-C is for this one.
    process = subprocess.Popen(command, stdin=subprocess.PIPE, start_new_session=True)
    try:
        yield
    finally:
        try:
            process.communicate(timeout=PATIENCE)
        except subprocess.TimeoutExpired:
            process.kill()


def _end_with_parent() -> None:
    """Wait until the other end of the pipe is gone, and end as by Ctrl-C."""
    os.read(sys.stdin.fileno(), 1)  # not its own read, whose lock would be held at the end
    os.kill(os.getpid(), signal.SIGINT)


def _spin(nodes: Sequence[GraphNode], values: Mapping[str, str | int], args: Sequence[str]) -> int:
    interruption = Interruption()
    running: list[Node] = []
    started = False
    files = [file for word, file in pairwise(args) if word == "--params-file"]
    try:
        with suppress(KeyboardInterrupt):
            _init(args)
            for node in nodes:
                kind = getattr(importlib.import_module(f"gesture_bot.nodes.{node.name}"), node.class_name)
                overrides = [Parameter(name, value=values[name]) for name in node.arguments if name in values]
                # One that takes hardware is built to its end, so that it can give it back.
                interruption.held = issubclass(kind, ManagedNode)
                running.append(
                    kind(node.name, namespace=values.get("namespace", ""), parameter_overrides=overrides)
                )
                interruption.check()
                check_parameters(running[-1], files)
            started = True
            _work(running)
    except GestureBotError as error:
        return _report(error)
    finally:
        interruption.ignore()  # also where something else than a signal ended it
        # The bus first: it was built last, and brings the robot to rest while the others still stand.
        for built in reversed(running):
            built.destroy_node()
        rclpy.try_shutdown()
    if not started:
        # A node was interrupted half-way; what its libraries have begun may abort a process that ends itself.
        sys.stdout.flush()
        os._exit(0)
    return 0


def _init(args: Sequence[str]) -> None:
    try:
        # Its own handlers of signals end the context, in which a node that is being built would fail.
        rclpy.init(args=list(args), signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:  # it tells what is wrong with the arguments, and where in its own code
        raise GestureBotError(re.sub(r", at \S+:\d+", "", str(error))) from error


def _work(nodes: Sequence[Node]) -> None:
    # Not rclpy's events executor: in rclpy 7.1.6 a node's timers never fire under it.
    executor = SingleThreadedExecutor()
    for node in nodes:
        executor.add_node(node)
    try:
        install_signal_handlers()  # they wake an executor that waits, and pass the signal on
        with until_shutdown(rclpy.get_default_context()):
            executor.spin()
    finally:
        uninstall_signal_handlers()  # their thread may still be at the executors, which end now


def run_nodes(arguments: Sequence[str], nodes: Sequence[GraphNode], **values: str) -> int:
    """Run some nodes in this process until they end, or are told to stop; the exit status.

    Args:
        arguments: NAME:=VALUE strings of the graph's arguments that the nodes take.
        nodes: Which nodes.
        values: Their other parameters.
    """
    keep_local()
    used = {name for node in nodes for name in node.arguments}
    try:
        given = parse_arguments(arguments, [*(a for a in ARGUMENTS if a.name in used), *COMMON])
        settings = _settings(given)
    except GestureBotError as error:
        return _report(error)
    return _spin(nodes, {**given, **values}, settings)


def _report(error: GestureBotError) -> int:
    print(f"gesture-bot: {error}", file=sys.stderr)
    return 1


if __name__ == "__main__":
    os.nice(10)  # the servo bus goes first
    threading.Thread(target=_end_with_parent, daemon=True).start()
    raise SystemExit(start_node(sys.argv.pop(1)))
