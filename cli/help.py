"""What the `gesture-bot` command tells people about itself."""

import argparse
import sys
import textwrap
from typing import Any, NoReturn

GUIDE = """\
gesture-bot makes a social robot gesture while it speaks.

  gesture-bot doctor                          is all there that it needs; what to do where not
  gesture-bot demo                            a minute of a simulated robot that talks with its hands
  gesture-bot run                             the graph: it waits for text, and can be steered
  gesture-bot run studio:=true                the same with a page in the browser
  gesture-bot run text:="Hello, I am glad to see you." emotion:=happy

your robot
  gesture-bot robot add mine.urdf             a file that says how people's motion maps to it
  gesture-bot demo robot:=mine.yaml           it talks, in simulation
your servos
  gesture-bot servos scan                     which there are
  gesture-bot servos check mine.yaml          what does not fit the robot's file
keep what it did
  gesture-bot record talk.mcap                beside a running graph; replay and export take it
your recordings and gestures
  gesture-bot build-database recordings/ -o mine.safetensors
  gesture-bot bank preview hello              a gesture that falls on a word

All commands: gesture-bot --help. One of them: gesture-bot run --help
Pages to follow in order: docs/README.md of the source"""
"""What somebody reads who types `gesture-bot` alone."""


class Parser(argparse.ArgumentParser):
    """A parser of a command, whose help ends with examples.

    Args:
        examples: Command lines, one a line.
    """

    def __init__(self, *arguments: Any, examples: str = "", **options: Any):
        options.setdefault("formatter_class", Help)
        super().__init__(*arguments, **options)
        if examples:
            self.epilog = f"{self.epilog or ''}examples:\n" + textwrap.indent(examples, "  ")

    def error(self, message: str) -> NoReturn:
        """Say what is wrong with the command line, and where to read on; the exit status is 2."""
        if message.startswith("unrecognized arguments"):
            message += "; those of run, demo and replay are written NAME:=VALUE"
        self.print_usage(sys.stderr)
        self.exit(2, f"{self.prog}: error: {message}\nTry: {self.prog} --help\n")


class Help(argparse.HelpFormatter):
    """Fills descriptions, and leaves what has lines of its own as it is."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        return text if "\n" in text else super()._fill_text(text, width, indent)
