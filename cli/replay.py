"""`gesture-bot replay`: a recording moves a robot, and is heard."""

import argparse

from gesture_bot.nodes.graph import NODES, GraphNode
from gesture_bot.nodes.start import run_nodes

PLAYER = GraphNode("player", "Player", ("recording", "robot"))
"""First of all nodes: where a graph is running already, it refuses to start before anything moves."""

PLAYED_ON = ("loudspeaker", "retargeter", "motion_mux", "servo_driver")


def command(options: argparse.Namespace) -> int:
    """`gesture-bot replay`: play a recording with NAME:=VALUE arguments; the exit status.

    Args:
        options: recording, the file; arguments, of the nodes that it is played on.
    """
    nodes = [node for node in NODES if node.name in PLAYED_ON]
    return run_nodes(options.arguments, [PLAYER, *nodes], recording=str(options.recording))
