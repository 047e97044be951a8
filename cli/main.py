# PYTHON_ARGCOMPLETE_OK
"""`gesture-bot`: the command line. Each command imports what it needs when it runs: help answers at once."""

import argparse
import importlib
import os
import sys
from collections.abc import Sequence

from gesture_bot.base.errors import GestureBotError
from gesture_bot.cli.database_commands import add_database_commands
from gesture_bot.cli.graph_commands import add_graph_commands
from gesture_bot.cli.help import GUIDE, Parser
from gesture_bot.cli.robot_commands import add_robot_commands


def main(argv: Sequence[str] | None = None) -> int:
    """Parse the command line and run one command; the exit status."""
    parser = command_line()
    if "_ARGCOMPLETE" in os.environ:  # the shell asks what could be typed next
        importlib.import_module("argcomplete").autocomplete(parser)
    options = parser.parse_args(argv)
    if "module" not in options:
        print(GUIDE)
        return 0
    try:
        return importlib.import_module(f"gesture_bot.cli.{options.module}").command(options)
    except GestureBotError as error:
        print(f"gesture-bot: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130


def command_line() -> argparse.ArgumentParser:
    """The parser of all commands."""
    parser = Parser(
        prog="gesture-bot",
        description="Makes a social robot gesture while it speaks.",
        examples="gesture-bot doctor\ngesture-bot demo\ngesture-bot run --help",
    )
    commands = parser.add_subparsers(title="commands", metavar="COMMAND")
    add_graph_commands(commands)
    add_database_commands(commands)
    add_robot_commands(commands)
    completion = commands.add_parser(
        "completion",
        help="print what lets a shell complete commands, arguments and their values",
        description="Print the completion for a shell, by argcomplete. A line of the examples in ~/.bashrc, "
        "~/.zshrc (behind compinit) or ~/.config/fish/config.fish is for every new shell.",
        examples='eval "$(gesture-bot completion bash)"\n'
        'eval "$(gesture-bot completion zsh)"\n'
        "gesture-bot completion fish | source",
    )
    completion.add_argument("shell", choices=("bash", "zsh", "fish"), help="shell")
    completion.set_defaults(module="completion")
    return parser


if __name__ == "__main__":
    raise SystemExit(main())
