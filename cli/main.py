# PYTHON_ARGCOMPLETE_OK
"""`gesture-bot`: the command line. Each command imports what it needs when it runs: help answers at once."""

import argparse
import importlib
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from gesture_bot.base.errors import GestureBotError
from gesture_bot.cli.completion import complete_graph
from gesture_bot.cli.help import GUIDE, Parser
from gesture_bot.nodes.graph import ARGUMENTS, COMMON


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

    _add_recordings(commands)

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

    build = commands.add_parser(
        "build-database",
        help="make a gesture database from recordings of people",
        description="Make a gesture database from recordings of people who speak and gesture: BVH with "
        "sound, keypoint tables with sound, the LSG21 data set, landmark arrays. An interrupted build goes "
        "on where it was.",
        examples="gesture-bot build-database recordings/ -o mine.safetensors\n"
        "gesture-bot build-database recordings/ -o mine.safetensors --labels labels.csv",
    )
    build.add_argument("sources", nargs="+", type=Path, metavar="SOURCE", help="file, or folder to search")
    build.add_argument(
        "-o", "--output", type=Path, required=True, metavar="FILE", help="database file, .safetensors"
    )
    build.add_argument("--map", metavar="NAME|FILE", help="skeleton map (found by itself where it fits)")
    build.add_argument(
        "--labels", type=Path, metavar="TABLE.csv", help="table: file, emotion, style, speaker"
    )
    build.add_argument("--licence", default="not stated", metavar="TEXT", help="licence of the recordings")
    build.add_argument(
        "--future", choices=("real", "zeros"), default="real",
        help="what follows a sequence: the recording's next frames, or zeros as in MM22's code (real)",
    )  # fmt: skip
    build.add_argument("--workers", type=int, default=os.cpu_count(), metavar="N", help="processes")
    build.set_defaults(module="build_database")

    inspect = commands.add_parser(
        "inspect",
        help="print and draw what a gesture database holds",
        description="Print what a gesture database holds, and draw it: histograms and a sheet of poses.",
        examples="gesture-bot inspect demo\ngesture-bot inspect mine.safetensors -o mine.png",
    )
    inspect.add_argument("database", metavar="FILE", help="database file, or 'demo'")
    inspect.add_argument("-o", "--output", type=Path, metavar="PICTURE.png", help="picture (FILE's name)")
    inspect.set_defaults(module="inspect_database")

    train = commands.add_parser(
        "train",
        help="train a network that refines what the search finds",
        description="Train the refinement network of MM22 on a gesture database, with PyTorch (pip install "
        "'gesture-bot[train]'), on a GPU where there is one; on several with torchrun. An interrupted "
        "training goes on where it was. The curves are written beside the model, as .csv and .png.",
        examples="gesture-bot train demo -o quick.onnx --quick\n"
        "gesture-bot train mine.safetensors -o mine.onnx",
    )
    train.add_argument("database", metavar="DATABASE", help="database file, or 'demo'")
    train.add_argument("-o", "--output", type=Path, required=True, metavar="MODEL.onnx", help="model file")
    train.add_argument(
        "--speech", metavar="DATABASE",
        help="more recordings to learn from, for whose sound DATABASE is searched; 'shuffled:8' for 'demo'",
    )  # fmt: skip
    train.add_argument("--iterations", type=int, default=300_000, metavar="N", help="as MM22: 300000")
    train.add_argument(
        "--recipe", choices=("paper", "light", "steered"), default="paper",
        help="as MM22; light: without a GPU, with a smaller critic and faster steps; steered: the same, and "
        "the network sees the controls (paper)",
    )  # fmt: skip
    train.add_argument("--batch", type=int, default=100, metavar="N", help="windows in a batch (100)")
    train.add_argument(
        "--width", type=float, default=1.0, metavar="SHARE",
        help="channels, as a share of MM22's: a model takes 20 MB at 1, 5 MB at 0.5 (1)",
    )  # fmt: skip
    train.add_argument("--seed", type=int, default=0, help="of everything that is drawn at random (0)")
    train.add_argument("--quick", action="store_true", help="prove in two minutes that it works")
    train.set_defaults(module="train")

    evaluate = commands.add_parser(
        "evaluate",
        help="measure what the method does",
        examples="gesture-bot evaluate controls\ngesture-bot evaluate quality -o quality/",
    )
    measures = evaluate.add_subparsers(title="what", metavar="WHAT", required=True)
    controls = measures.add_parser(
        "controls",
        help="do the motion controls do what they say (MM22, table 2)",
        description="Make motion for speech under each control, and measure it (MM22, table 2).",
        examples="gesture-bot evaluate controls\n"
        "gesture-bot evaluate controls --database mine.safetensors --speech talk.wav -o controls.csv",
    )
    controls.add_argument("--database", default="demo", metavar="FILE", help="database file (demo)")
    controls.add_argument(
        "--speech", nargs="+", type=Path, default=[], metavar="WAV", help="sound files (the embedded voice)"
    )
    controls.add_argument("-o", "--output", type=Path, metavar="TABLE.csv", help="write the table, too")
    controls.set_defaults(module="evaluate_controls")

    rhythm = measures.add_parser(
        "rhythm",
        help="do the hands move on the beats of the speech (RG22, figure 11)",
        description="Make motion for speech with and without alignment to its beats, and count the hands' "
        "beats that fall on beats of the speech (RG22, figure 11).",
        examples="gesture-bot evaluate rhythm -o rhythm.png",
    )
    rhythm.add_argument("--database", default="demo", metavar="FILE", help="database file (demo)")
    rhythm.add_argument(
        "--speech", nargs="+", type=Path, default=[], metavar="FILE",
        help="sound files, or recordings of motion with sound (the embedded voice)",
    )  # fmt: skip
    rhythm.add_argument(
        "-o", "--output", type=Path, metavar="OUT", help="write the curves: a picture, .png, or a table, .csv"
    )
    rhythm.set_defaults(module="evaluate_rhythm")

    quality = measures.add_parser(
        "quality",
        help="how good is the motion (MM22, table 3, in numbers)",
        description="Make motion for speech by each kind of search, and compare it with the speaker's own, "
        "which the database must not hold (MM22, table 3, in numbers).",
        examples="gesture-bot evaluate quality -o quality/\n"
        "gesture-bot evaluate quality --database mine.safetensors --speech held_out/one.bvh held_out/two.bvh",
    )
    quality.add_argument("--database", default="demo", metavar="FILE", help="database file (demo)")
    quality.add_argument(
        "--speech", nargs="+", type=Path, default=[], metavar="FILE",
        help="recordings of motion with sound or speech features (held-out sentences of the demo speaker)",
    )  # fmt: skip
    model = next(argument for argument in ARGUMENTS if argument.name == "model")
    for measure in (controls, quality):
        measure.add_argument(
            "--model",
            default=model.default,
            metavar="NAME|FILE",
            help=f"{model.description} ({model.default})",
        )
    quality.add_argument("-o", "--output", type=Path, metavar="FOLDER", help="write CSV, Markdown and plots")
    quality.set_defaults(module="evaluate_quality")

    bank = commands.add_parser(
        "bank", help="look at the semantic gestures", examples="gesture-bot bank preview hello"
    )
    actions = bank.add_subparsers(title="what", metavar="WHAT", required=True)
    preview = actions.add_parser(
        "preview",
        help="draw a gesture of a semantic bank",
        description="Draw a gesture of a semantic bank, from the front and from the side.",
        examples="gesture-bot bank preview hello -o hello.gif\n"
        "gesture-bot bank preview salute --bank my_banks/mine.yaml",
    )
    preview.add_argument("gesture", metavar="NAME", help="gesture")
    preview.add_argument(
        "-o", "--output", type=Path, metavar="PICTURE", help=".png, or .gif to see it move (NAME.png)"
    )
    preview.add_argument("--bank", type=Path, metavar="FILE.yaml", help="bank of your own")
    preview.set_defaults(module="bank_preview")
    _add_servos(commands)

    robot = commands.add_parser(
        "robot",
        help="make a robot of your own fit, and check it",
        examples="gesture-bot robot add mine.urdf\ngesture-bot robot check mine.yaml",
    )
    tasks = robot.add_subparsers(title="what", metavar="WHAT", required=True)
    add = tasks.add_parser(
        "add",
        help="propose a mapping for a robot from its URDF",
        description="Find torso, arms and head in a URDF, propose how people's motion maps to them and how "
        "the robot rests, write it to a YAML file for you to correct, and draw the robot so.",
        examples="gesture-bot robot add robots/nao.urdf -o nao.yaml",
    )
    add.add_argument("urdf", type=Path, metavar="URDF", help="URDF file; its meshes need not be there")
    add.add_argument("-o", "--output", type=Path, metavar="FILE.yaml", help="mapping (URDF's name)")
    add.set_defaults(module="robot", action="add")
    rest = tasks.add_parser(
        "rest",
        help="propose a robot's rest pose again, after you have corrected its links",
        description="Let the arms hang down as `add` does, by the links that the file names now, and change "
        "the arms' rest angles in the file. Nothing else in it is changed.",
        examples="gesture-bot robot rest nao.yaml",
    )
    rest.add_argument("robot", metavar="FILE.yaml", help="mapping")
    rest.set_defaults(module="robot", action="rest")
    check = tasks.add_parser(
        "check",
        help="check a robot's mapping",
        description="Check a robot's limits, chains, axes, rest pose, reach and servo table. `ok` is well; "
        "`look` may be meant so, and is worth a look at the robot or its picture; `bad` must be mended, and "
        "makes the exit status 1.",
        examples="gesture-bot robot check toa\ngesture-bot robot check nao.yaml -o nao.png",
    )
    check.add_argument("robot", metavar="NAME|FILE.yaml", help="robot")
    check.add_argument("-o", "--output", type=Path, metavar="PICTURE.png", help="draw its rest pose, too")
    check.set_defaults(module="robot", action="check")

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


def _add_recordings(commands: "argparse._SubParsersAction[Parser]") -> None:
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


def _add_servos(commands: "argparse._SubParsersAction[Parser]") -> None:
    servos = commands.add_parser(
        "servos",
        help="find, set up, calibrate and watch Dynamixel servos",
        examples="gesture-bot servos scan\ngesture-bot servos check mine.yaml",
    )
    actions = servos.add_subparsers(title="what", metavar="WHAT", required=True)
    port = Parser(add_help=False)
    port.add_argument("--port", help="serial port (the only one)")
    robot = Parser(add_help=False)
    robot.add_argument(
        "--port", help="serial port (the only one); of a robot with several buses 'left=PORT right=PORT'"
    )
    robot.add_argument("robot", metavar="ROBOT", help="name of a robot, or path of its YAML file")

    scan = actions.add_parser(
        "scan",
        help="list the servos on the serial ports",
        description="List the servos on the serial ports: port, baud rate, ID, model, firmware. "
        "It takes ten seconds a port.",
        examples="gesture-bot servos scan\n"
        "gesture-bot servos scan --port /dev/ttyUSB0 --baudrate 57600 1000000",
    )
    scan.add_argument("--port", dest="ports", nargs="+", metavar="PORT", help="serial port (all)")
    scan.add_argument(
        "--baudrate", nargs="+", type=int, metavar="BIT/S", help="baud rate (all that servos have)"
    )
    scan.set_defaults(module="servos_scan")

    change = actions.add_parser(
        "id",
        parents=[port],
        help="give a servo another ID, and another baud rate",
        description="Give a servo another ID, and another baud rate if asked. Connect new servos one at "
        "a time: all have the ID 1.",
        examples="gesture-bot servos id 1 11 --set-baudrate 1000000",
    )
    change.add_argument("old", type=int, metavar="OLD", help="its ID now")
    change.add_argument("new", type=int, metavar="NEW", help="its ID from now on, 0 to 252")
    change.add_argument("--baudrate", type=int, metavar="BIT/S", help="its baud rate now (found by itself)")
    change.add_argument(
        "--set-baudrate", type=int, metavar="BIT/S", help="its baud rate from now on (as it is)"
    )
    change.set_defaults(module="servos_id")

    check = actions.add_parser(
        "check",
        parents=[robot],
        help="compare the servos with what a robot needs",
        description="Compare the servos with what a robot needs: model, firmware, operating mode, delay, "
        "limits. Ends with 1 when something is not as it should be.",
        examples="gesture-bot servos check mine.yaml\n"
        "gesture-bot servos check mine.yaml --port /dev/ttyUSB0 --apply",
    )
    check.add_argument("--apply", action="store_true", help="change what is not as it should be")
    check.set_defaults(module="servos_check")

    calibrate = actions.add_parser(
        "calibrate",
        parents=[robot],
        help="set the servos' zero: move each joint to its mark by hand",
        description="Set the servos' zero. Torque goes off at the joints that are calibrated, each is moved "
        "to its mark by hand, and its servo's Homing Offset is set. The mark stands in the robot's file; "
        "without one it is at zero.",
        examples="gesture-bot servos calibrate mine.yaml\n"
        "gesture-bot servos calibrate mine.yaml left_elbow\n"
        "gesture-bot servos calibrate mine.yaml --undo",
    )
    calibrate.add_argument("joints", nargs="*", metavar="JOINT", help="joint to calibrate (all)")
    calibrate.add_argument(
        "--undo", action="store_true", help="go back to what it was before the last calibration, or undo"
    )
    calibrate.set_defaults(module="servos_calibrate")

    monitor = actions.add_parser(
        "monitor",
        parents=[robot],
        help="watch the servos: position, current, temperature, voltage, errors",
        description="Watch the servos in a live table until Ctrl-C. It only reads. While a driver uses "
        "the port, look at /diagnostics instead.",
        examples="gesture-bot servos monitor mine.yaml",
    )
    monitor.set_defaults(module="servos_monitor")


if __name__ == "__main__":
    raise SystemExit(main())
