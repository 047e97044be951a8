"""`gesture-bot`: run the graph, watch the demo, render a file."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from gesture_bot.base.errors import GestureBotError
from gesture_bot.nodes.graph import ARGUMENTS, NAMESPACE


def main(argv: Sequence[str] | None = None) -> int:
    """Parse the command line and run one command; the exit status."""
    parser = _parser()
    options = parser.parse_args(argv)
    if "run" not in options:
        parser.print_help()
        return 0
    try:
        return options.run(options)
    except GestureBotError as error:
        print(f"gesture-bot: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="gesture-bot",
        description="Makes a social robot gesture while it speaks.",
        epilog="Next: gesture-bot demo",
    )
    commands = parser.add_subparsers(title="commands", metavar="COMMAND")

    run = commands.add_parser(
        "run",
        help="run all nodes in this process",
        description="Run all nodes in this process. Ctrl-C brings the robot to rest and ends.",
        epilog="arguments:\n"
        + "\n".join(
            f"  {argument.name}:={'...' if argument.default == '' else argument.default}\n"
            f"      {argument.description}"
            for argument in (*ARGUMENTS, NAMESPACE)
        )
        + "\n\nexample: gesture-bot run text:='Hello, I am glad to see you.' emotion:=happy",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    run.add_argument("arguments", nargs="*", metavar="NAME:=VALUE")
    run.set_defaults(run=_run)

    demo = commands.add_parser(
        "demo",
        help="watch a simulated robot talk with its hands",
        description="Run the graph in simulation, "
        "steer it, and write a film, a timeline and a summary. Takes about a minute.",
    )
    demo.add_argument(
        "-o", "--output", type=Path, default=Path("demo_out"), help="folder to write into (demo_out)"
    )
    demo.set_defaults(run=_demo)

    render = commands.add_parser(
        "render",
        help="make the motion for a sound file, faster than real time",
        description="Make the motion for a sound file, faster than real time and without ROS.",
        epilog="example: gesture-bot render speech.wav -o speech.bvh --emotion happy",
    )
    render.add_argument("speech", type=Path, metavar="IN.wav", help="sound file")
    render.add_argument(
        "-o", "--output", type=Path, required=True, metavar="OUT",
        help=".bvh (the human skeleton), .csv (the robot's joint angles) or .gif (the robot)",
    )  # fmt: skip
    defaults = {argument.name: argument for argument in ARGUMENTS}
    for name in ("database", "emotion", "robot", "seed"):
        argument = defaults[name]
        render.add_argument(
            f"--{name}", default=argument.default, type=type(argument.default),
            help=f"{argument.description} ({argument.default})",
        )  # fmt: skip
    render.set_defaults(run=_render)
    return parser


# Each command imports what it needs when it runs: help answers at once.


def _run(options: argparse.Namespace) -> int:
    from gesture_bot.nodes.start import run_graph

    return run_graph(options.arguments)


def _demo(options: argparse.Namespace) -> int:
    from gesture_bot.cli.demo import run_demo

    return run_demo(options.output)


def _render(options: argparse.Namespace) -> int:
    from gesture_bot.cli.render import render

    render(
        options.speech, options.output,
        database=options.database, emotion=options.emotion, robot_name=options.robot, seed=options.seed,
    )  # fmt: skip
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
