"""The commands around recordings of people: build a database, look at it, train on it, measure."""

import argparse
import os
from pathlib import Path

from gesture_bot.cli.help import Parser
from gesture_bot.nodes.graph import ARGUMENTS


def add_database_commands(commands: "argparse._SubParsersAction[Parser]") -> None:
    """Add `build-database`, `inspect`, `train` and `evaluate`."""
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
    build.add_argument(
        "--licence", default="not stated", metavar="TEXT", help="of the recordings (not stated)"
    )
    build.add_argument(
        "--future", choices=("real", "zeros"), default="real",
        help="what follows a sequence: the recording's next frames, or zeros as in MM22's code (real)",
    )  # fmt: skip
    build.add_argument(
        "--workers",
        type=int,
        default=os.cpu_count(),
        metavar="N",
        help="processes (one a processor)",
    )
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
    _add_measures(commands)


def _add_measures(commands: "argparse._SubParsersAction[Parser]") -> None:
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
