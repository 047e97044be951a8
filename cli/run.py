"""`gesture-bot run`: the graph in this process."""

import argparse

from gesture_bot.nodes.start import run_graph


def command(options: argparse.Namespace) -> int:
    """Run the graph with NAME:=VALUE arguments; the exit status."""
    return run_graph(options.arguments)
