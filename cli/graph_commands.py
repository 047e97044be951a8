"""The commands around the graph: check the machine, run, watch, take over, record, render."""

import argparse
from pathlib import Path

from gesture_bot.cli.completion import complete_graph
from gesture_bot.cli.help import Parser
from gesture_bot.nodes.graph import ARGUMENTS, COMMON


def add_graph_commands(commands: "argparse._SubParsersAction[Parser]") -> None:
    """Add `doctor`, `run`, `demo`, `teleop`, `record`, `replay`, `export` and `render`."""
    doctor = commands.add_parser(
        "doctor",
        help="check this machine, and say what to do",
        description="Check what gesture_bot needs of this machine: versions, ROS 2, sound, serial ports, "
        "permissions, memory. `ok` is well; `look` is worth a look, or only some need it; `bad` must be "
        "mended, and makes the exit status 1. Paste the table into an issue.",
        examples="gesture-bot doctor",
    )
    doctor.set_defaults(module="doctor")

    run = commands.add_parser(
        "run",
        help="run all nodes in this process",
        description="Run all nodes in this process. Ctrl-C brings the robot to rest and ends.",
        epilog="arguments:\n"
        + "\n".join(
            f"  {argument.name}:={'...' if argument.default == '' else argument.default}\n"
            f"      {argument.description}"
            for argument in (*ARGUMENTS, *COMMON)
        )
        + "\n\n",
        examples="gesture-bot run\n"
        "gesture-bot run text:='Hello, I am glad to see you.' emotion:=happy\n"
        "gesture-bot run robot:=mine.yaml port:=/dev/ttyUSB0 microphone:=default",
    )
    graph = run.add_argument("arguments", nargs="*", metavar="NAME:=VALUE")
    graph.completer = complete_graph  # type: ignore[attr-defined]
    run.set_defaults(module="run")

    demo = commands.add_parser(
        "demo",
        help="watch a simulated robot talk with its hands",
        description="Run the graph in simulation, "
        "steer it, and write a film, a timeline and a summary. Takes about a minute.",
        examples="gesture-bot demo\ngesture-bot demo robot:=mine.yaml -o mine_talks",
    )
    demo.add_argument(
        "arguments", nargs="*", metavar="NAME:=VALUE",
        help="robot:=NAME|FILE (toa); studio:=true|false, a page in the browser (true where a display is); "
        "studio_address:=HOST:PORT",
    )  # fmt: skip
    demo.add_argument(
        "-o", "--output", type=Path, default=Path("demo_out"), help="folder to write into (demo_out)"
    )
    demo.set_defaults(module="demo")

    teleop = commands.add_parser(
        "teleop",
        help="move a robot's joints by keys, while it gestures",
        description="Take joints from the gestures and move them by keys, one by one or to a pose, while the "
        "graph runs in another terminal. It tells its keys. Joints that you do not move go on gesturing.",
        examples="gesture-bot teleop\ngesture-bot teleop mine.yaml",
    )
    teleop.add_argument("robot", nargs="?", default="toa", metavar="ROBOT", help="name or YAML file (toa)")
    teleop.set_defaults(module="teleop")

    record = commands.add_parser(
        "record",
        help="record the topics of a running graph",
        description="Record every topic, or those named, into an MCAP file until Ctrl-C, while the graph "
        "runs in another terminal. Foxglove, `ros2 bag` and rosbags open it, too.",
        examples="gesture-bot record talk.mcap",
    )
    record.add_argument("output", type=Path, metavar="OUT.mcap", help="file to write")
    record.add_argument("--topics", nargs="+", default=[], metavar="TOPIC", help="record only these (all)")
    record.add_argument("--overwrite", action="store_true", help="even if the file is there already")
    record.set_defaults(module="record")

    replay = commands.add_parser(
        "replay",
        help="let a robot move and speak as in a recording",
        description="Let a robot, simulated or real, move and speak as in a recording, without the graph "
        "that makes gestures. Stop and teleoperation work as ever. Another robot than the recorded one makes "
        "the same gestures in its own way.",
        examples="gesture-bot replay talk.mcap robot:=mine.yaml port:=/dev/ttyUSB0",
    )
    replay.add_argument("recording", type=Path, metavar="FILE.mcap", help="recording")
    replay.add_argument(
        "arguments", nargs="*", default=[], metavar="NAME:=VALUE",
        help="robot, port, loudspeaker, namespace, parameters, as of `run`",
    )  # fmt: skip
    replay.set_defaults(module="replay")

    export = commands.add_parser(
        "export",
        help="turn a recording into BVH, CSV, sound or video",
        description="Turn a recording into BVH (the human skeleton, 15 frames a second), CSV (the measured "
        "joints), WAV (what was heard) or MP4 (the robot, with its voice; it takes ffmpeg, or "
        "pip install 'gesture-bot[video]'). All begin at the same moment.",
        examples="gesture-bot export talk.mcap -o talk.mp4",
    )
    export.add_argument("recording", type=Path, metavar="FILE.mcap", help="recording")
    export.add_argument(
        "-o", "--output", type=Path, required=True, metavar="OUT", help=".bvh, .csv, .wav or .mp4"
    )
    export.add_argument("--robot", default="toa", help="Robot in the video: a name, or a YAML file (toa)")
    export.set_defaults(module="export")

    render = commands.add_parser(
        "render",
        help="make the motion for a sound file, faster than real time",
        description="Make the motion for a sound file, faster than real time and without ROS.",
        examples="gesture-bot render speech.wav -o speech.bvh --emotion happy\n"
        "gesture-bot render speech.wav -o speech.gif --robot mine.yaml",
    )
    render.add_argument("speech", type=Path, metavar="IN.wav", help="sound file")
    render.add_argument(
        "-o", "--output", type=Path, required=True, metavar="OUT",
        help=".bvh (the human skeleton), .csv (the robot's joint angles) or .gif (the robot)",
    )  # fmt: skip
    defaults = {argument.name: argument for argument in ARGUMENTS}
    for name in ("database", "model", "emotion", "robot", "seed"):
        argument = defaults[name]
        render.add_argument(
            f"--{name}", default=argument.default, type=type(argument.default),
            help=argument.description + (argument.default != "") * f" ({argument.default})",
        )  # fmt: skip
    render.set_defaults(module="render")
