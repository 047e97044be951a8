"""The commands around gestures and robots: look at a bank, set up servos, make a robot fit."""

import argparse
from pathlib import Path

from gesture_bot.cli.help import Parser


def add_robot_commands(commands: "argparse._SubParsersAction[Parser]") -> None:
    """Add `bank`, `servos` and `robot`."""
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
