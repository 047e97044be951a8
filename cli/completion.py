"""`gesture-bot completion`: what a shell offers when somebody presses Tab, by argcomplete."""

import argparse

from gesture_bot.nodes.graph import ARGUMENTS, COMMON

FILES = {
    "speech": ("wav", "flac", "ogg"),
    "database": ("safetensors",),
    "model": ("onnx",),
    "banks": ("yaml",),
    "robot": ("yaml",),
    "parameters": ("yaml",),
}
"""Endings of the files that an argument may be; folders lead to them, or are it."""


def command(options: argparse.Namespace) -> int:
    """Print what a shell has to read; the exit status."""
    from argcomplete import shellcode

    print(shellcode(["gesture-bot"], shell=options.shell))
    return 0


def complete_graph(prefix: str, **_: object) -> list[str]:
    """The NAME:=VALUE arguments of the graph that may begin so; values where there is a list of them."""
    from argcomplete.completers import FilesCompleter

    name, separator, value = prefix.partition(":=")
    if not separator:
        return [f"{argument.name}:=" for argument in (*ARGUMENTS, *COMMON)]
    files = FilesCompleter(FILES[name])(value) if name in FILES else []
    return [f"{name}:={value}" for value in (*_values(name), *files)]


def _values(name: str) -> list[str]:
    if name == "emotion":
        from gesture_bot.matching.emotions import load_emotions

        return list(load_emotions())
    if name == "robot":
        from gesture_bot.retarget.robot import robot_names

        return robot_names()
    return {
        "speech": ["say"],
        "voice": ["embedded", "espeak"],
        "loudspeaker": ["default", "off"],
        "microphone": ["default", "off", "topic"],
        "database": ["demo"],
        "model": ["shipped", "none"],
        "banks": ["shipped"],
        "port": ["virtual"],
        "rviz": ["true", "false"],
        "studio": ["true", "false"],
    }.get(name, [])
