"""`gesture-bot servos`, through packets on a virtual bus."""

import os
import signal
import subprocess
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
from conftest import command, wait_until
from servo_bus import recorded_bus

from gesture_bot.base.errors import BusError, RobotError
from gesture_bot.cli.main import main
from gesture_bot.retarget.robot import load_robot
from gesture_bot.servo.bus import Bus
from gesture_bot.servo.calibration import calibrate, read_angle
from gesture_bot.servo.driver import Driver
from gesture_bot.servo.models import P
from gesture_bot.servo.monitor import read_states
from gesture_bot.servo.settings import Change, apply, inspect
from gesture_bot.servo.virtual_servo import ServoSpec

pytestmark = pytest.mark.live

ROBOT = load_robot("toa")
BAUDRATE = ROBOT.bus.baudrate
SERVO = {servo.joint: servo for servo in ROBOT.servos}
ELBOW = SERVO["left_elbow"]
FACTORY = 57_600
NEW = ServoSpec(1, "XL430-W250", baudrate=FACTORY)


def servos(*arguments: object) -> int:
    return main(["servos", *map(str, arguments)])


@pytest.fixture
def typed(monkeypatch, tmp_path):
    """What somebody types, and a state folder of one's own."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    reading, writing = os.pipe()
    with os.fdopen(reading) as keyboard, os.fdopen(writing, "w", buffering=1) as hands:
        monkeypatch.setattr("sys.stdin", keyboard)
        yield hands


def test_scan_finds_each_servo_at_its_baud_rate_and_two_with_one_id(capsys):
    twins = ServoSpec(11, "XM430-W350", 3000, BAUDRATE), ServoSpec(14, "XM540-W150", 3000, BAUDRATE)
    with recorded_bus(ROBOT, [NEW, *twins]) as wire:
        assert servos("scan", "--port", wire.port, "--baudrate", FACTORY, BAUDRATE) == 0
        lines = capsys.readouterr().out.splitlines()
        listed = [line.split() for line in lines if line.startswith(wire.port)]
        assert listed[0] == [wire.port, str(FACTORY), "1", "XL430-W250", "48"]
        assert [int(row[2]) for row in listed[1:]] == [servo.id for servo in ROBOT.servos]
        assert {row[1] for row in listed[1:]} == {str(BAUDRATE)}
        shared = [line.split()[1] for line in lines if "two servos have this ID" in line]
        assert shared == ["11", "14"]

        assert servos("scan", "--port", wire.port, "--baudrate", 115_200) == 1
        assert "is the power on?" in capsys.readouterr().err
    assert servos("scan", "--port", "/dev/ttyNONE") == 1
    assert "cannot open the serial port: '/dev/ttyNONE'" in capsys.readouterr().err


def test_a_new_servo_gets_its_place_on_the_bus(capsys):
    arguments = ["--set-baudrate", BAUDRATE, "--port"]
    with recorded_bus(ROBOT, [NEW]) as wire:
        assert servos("id", 1, 14, *arguments, wire.port) == 1
        assert f"another servo on {wire.port} has the ID: 14" in capsys.readouterr().err
        assert servos("id", 1, 41, *arguments, wire.port) == 0
        wire.servos[41].reboot()
        with closing(Bus(wire.port, BAUDRATE)) as bus:
            assert bus.scan()[41].model == 1060
            bus.write(41, "Torque Enable", 1)
            with pytest.raises(BusError, match="refuses ID"):
                bus.write(41, "ID", 42)


def test_a_servo_that_shares_its_id_keeps_it(capsys):
    with recorded_bus(ROBOT, [ServoSpec(ELBOW.id, "XM540-W150", 3000, BAUDRATE)]) as wire:
        assert servos("id", ELBOW.id, 41, "--port", wire.port) == 1
        assert "two servos have this ID" in capsys.readouterr().err
        assert ELBOW.id in wire.servos and 41 not in wire.servos


def test_check_tells_changes_and_makes_them_once(typed, capsys):
    with recorded_bus(ROBOT) as wire:
        elbow = wire.servos[ELBOW.id]
        wrong = {"Operating Mode": 4, "Drive Mode": 4, "Shutdown": 0, "Velocity Limit": 10}
        for register, value in wrong.items():
            elbow.set(register, value)
        elbow.set("Torque Enable", 1)
        assert servos("check", "toa", "--port", wire.port) == 1
        assert wire.writes == [], "it only looks"
        told = capsys.readouterr().out
        assert "Operating Mode 4 -> 3" in told and "--apply" in told
        assert "Drive Mode 4 (time-based) -> 0" in told

        typed.write("\n")
        assert servos("check", "toa", "--apply", "--port", wire.port) == 0
        assert f"torque goes off at servo {ELBOW.id}" in capsys.readouterr().out
        assert elbow.get("Drive Mode") == 0
        assert elbow.get("Operating Mode") == 3 and elbow.get("Shutdown") == 0b110100
        # 0 to 2.5 rad, turned round, and 5 degrees more on both sides.
        assert elbow.get("Min Position Limit") == pytest.approx(2048 - (2.5 + 0.0873) * 4096 / 6.2832, abs=1)
        assert elbow.get("Max Position Limit") == pytest.approx(2048 + 0.0873 * 4096 / 6.2832, abs=1)

        wire.writes.clear()
        assert servos("check", "toa", "--apply", "--port", wire.port) == 0
        assert wire.writes == [], "EEPROM wears out"
        driver = Driver(ROBOT, wire.port)
        driver.start()
        driver.close()


def test_check_cuts_no_joint_or_model_in_a_narrow_terminal(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "60")
    with recorded_bus(ROBOT) as wire:
        assert servos("check", "toa", "--port", wire.port) == 1
    told = " ".join(capsys.readouterr().out.split())
    for servo in ROBOT.servos:
        assert f"{servo.joint} {servo.id} {servo.model} v48" in told


def test_check_names_what_no_setting_solves(capsys):
    other_model = replace(ROBOT, servos=(replace(ROBOT.servos[0], model="XM540-W150"), *ROBOT.servos[1:]))
    with recorded_bus(ROBOT, [ServoSpec(SERVO["left_wrist"].id, "XM540-W150", 99, BAUDRATE)]) as wire:
        wire.servos[31].set("Hardware Error Status", 1 << 2)
        wire.servos[32].set("Firmware Version", 37)
        wire.servos[21].set("Homing Offset", -200)
        with closing(Bus(wire.port, BAUDRATE)) as bus:
            bus.write(ELBOW.id, "Baud Rate", 1)
            assert (
                "is of the model XM430-W350" in inspect(bus, other_model, other_model.servos[0]).problems[0]
            )
        assert servos("check", "toa", "--port", wire.port) == 1
        told = capsys.readouterr().out
        for problem in (
            "servo 14 of left_elbow: does not answer",
            "servo 15 of left_wrist: damaged answers: two servos have this ID",
            "servo 31 of head_pan: reports overheating",
            "servo 32 of head_tilt: has no watchdog",
            "servo 21 of right_shoulder_pitch: passes the end of its turn",
        ):
            assert problem in told


def test_check_says_once_that_nobody_answers(capsys):
    with recorded_bus(ROBOT) as wire:
        for servo in wire.servos.values():
            servo.power = False
        assert servos("check", "toa", "--port", wire.port) == 1
    told = capsys.readouterr().err
    assert told.count("nobody answers at 1000000 bit/s") == 1 and wire.port in told


def test_eeprom_is_not_changed_behind_a_running_motor():
    with recorded_bus(ROBOT) as wire, closing(Bus(wire.port, BAUDRATE)) as bus:
        bus.write(ELBOW.id, "Torque Enable", 1)
        with pytest.raises(BusError, match="refuses Return Delay Time"):
            apply(bus, ELBOW, [Change("Return Delay Time", 250, 0)])


def test_calibration_is_guided_lasts_and_is_undone(typed, capsys):
    """Both elbows' horns are mounted some teeth off; somebody holds the arms stretched, which is the mark."""
    left, right = ELBOW, SERVO["right_elbow"]
    with recorded_bus(ROBOT) as wire:
        for servo, ticks in ((left, 2048 + 171), (right, 2048 - 228)):
            wire.servos[servo.id].position = ticks
        assert servos("calibrate", "toa", "--undo", "--port", wire.port) == 1
        assert "nothing to undo" in capsys.readouterr().err

        typed.write("q\n")
        assert servos("calibrate", "toa", left.joint, "--port", wire.port) == 0
        assert "undo" not in capsys.readouterr().out

        wire.servos[31].set("Torque Enable", 1)
        typed.write("\n\n")
        assert servos("calibrate", "toa", left.joint, right.joint, "--port", wire.port) == 0
        told = capsys.readouterr().out
        assert wire.servos[31].get("Torque Enable") == 1, "the head is not calibrated"
        wire.servos[31].set("Torque Enable", 0)
        assert "2 of 2" in told and "--undo" in told
        assert "left_elbow: homing offset 0 -> -171" in told and "right_elbow: homing offset 0 -> 228" in told
        for servo in (left, right):
            wire.servos[servo.id].reboot()
            with closing(Bus(wire.port, BAUDRATE)) as bus:
                assert read_angle(bus, servo) == pytest.approx(0.0, abs=0.002)

        assert servos("calibrate", "toa", "--undo", "--port", wire.port) == 0
        assert [wire.servos[servo.id].get("Homing Offset") for servo in (left, right)] == [0, 0]
        assert servos("calibrate", "toa", "--undo", "--port", wire.port) == 0
        assert [wire.servos[servo.id].get("Homing Offset") for servo in (left, right)] == [-171, 228]


def test_calibration_that_is_interrupted_says_what_is_done(typed, monkeypatch, capsys):
    lines = iter([""])

    def interrupted(*_):
        for line in lines:
            return line
        raise KeyboardInterrupt

    monkeypatch.setattr("gesture_bot.cli.servos_calibrate.answer", interrupted)
    with recorded_bus(ROBOT) as wire:
        wire.servos[31].position, wire.servos[32].position = 2048, 2048
        assert servos("calibrate", "toa", "head_pan", "head_tilt", "--port", wire.port) == 0
    told = capsys.readouterr().out
    assert "1 of 2 joints calibrated" in told and f"calibrate toa --port {wire.port} --undo" in told


def test_a_calibrated_joint_goes_where_it_is_sent():
    with recorded_bus(ROBOT) as wire, closing(Bus(wire.port, BAUDRATE)) as bus:
        wire.servos[ELBOW.id].position = 2048 + 171
        calibrate(bus, ROBOT, ELBOW)
        bus.write(ELBOW.id, "Torque Enable", 1)
        bus.write(ELBOW.id, "Goal Position", 2048 - 500)
        arrived = pytest.approx(2048 + 171 - 500, abs=1)
        wait_until(lambda: wire.servos[ELBOW.id].position == arrived, 3, "the elbow to arrive")
        assert bus.read(ELBOW.id, "Present Position") == pytest.approx(2048 - 500, abs=1)


def test_a_joint_that_moves_or_is_far_off_is_not_calibrated():
    pan = SERVO["head_pan"]
    with recorded_bus(ROBOT) as wire, closing(Bus(wire.port, BAUDRATE)) as bus:
        wire.servos[pan.id].position = 2048 + 1034
        with pytest.raises(RobotError, match=r"-91 deg .*offset in the robot's file to 1.586"):
            calibrate(bus, ROBOT, pan)
        assert calibrate(bus, ROBOT, replace(pan, offset=1.586)) == (0, 0)
        wire.servos[ELBOW.id].position = 1000
        with pytest.raises(RobotError, match="pass the end of the servo's turn"):
            calibrate(bus, ROBOT, ELBOW)
        bus.write(ELBOW.id, "Profile Velocity", 20)
        bus.write(ELBOW.id, "Torque Enable", 1)
        bus.write(ELBOW.id, "Goal Position", 2000)
        with pytest.raises(RobotError, match="left_elbow moves: hold it still"):
            calibrate(bus, ROBOT, ELBOW)
        assert wire.servos[pan.id].get("Homing Offset") == wire.servos[ELBOW.id].get("Homing Offset") == 0


def test_monitor_shows_hot_and_silent_servos_among_the_others():
    with recorded_bus(ROBOT) as wire, closing(Bus(wire.port, BAUDRATE)) as bus:
        wire.servos[31].set("Hardware Error Status", 1 << 2)
        wire.servos[31].temperature = 75.0
        bus.write(32, "Baud Rate", 1)
        states = dict(zip(ROBOT.joints, read_states(bus, ROBOT), strict=True))
        assert states["head_tilt"] is None
        assert states["head_pan"].errors == ("overheating",)
        assert states["head_pan"].temperature == 75
        elbow = states["left_elbow"]
        assert elbow.position == pytest.approx(0.35, abs=0.001)
        assert (elbow.torque, elbow.voltage, elbow.current, elbow.load) == (False, 12.0, None, 0.0)
        assert states["left_shoulder_roll"].current == 0.0


def test_monitor_runs_until_ctrl_c():
    with recorded_bus(ROBOT) as wire:
        wire.servos[31].set("Hardware Error Status", 1 << 2)
        with closing(Bus(wire.port, BAUDRATE)) as bus:
            bus.write(32, "Baud Rate", 1)
        asked = wire.questions
        arguments = command("servos", "monitor", "toa", "--port", wire.port)
        narrow = os.environ | {"COLUMNS": "60"}
        process = subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True, env=narrow)
        wait_until(lambda: wire.questions > asked + 12, 20, "its questions")
        process.send_signal(signal.SIGINT)
        shown, _ = process.communicate(timeout=10)
        assert process.returncode == 0
        assert all(joint in shown for joint in ROBOT.joints)
        assert "overheating, off" in shown and "does not answer" in shown


def test_servos_of_the_p_series_are_found_set_up_and_calibrated(capsys):
    limits = replace(ROBOT.limits, velocity=np.minimum(ROBOT.limits.velocity, 2.5))
    strong = tuple(replace(servo, model="PH54-100-S500") for servo in ROBOT.servos)
    robot = replace(ROBOT, servos=strong, limits=limits)
    with recorded_bus(robot, [ServoSpec(14, "PH54-100-S500", 5000, BAUDRATE)]) as wire:
        assert servos("scan", "--port", wire.port, "--baudrate", BAUDRATE) == 0
        lines = capsys.readouterr().out.splitlines()
        listed = [line.split()[2:4] for line in lines if line.startswith(wire.port)]
        assert listed == [[str(servo.id), servo.model] for servo in robot.servos]
        assert [line.split()[1] for line in lines if "two servos have this ID" in line] == ["14"]
    with recorded_bus(robot) as wire:
        servo, virtual = robot.servos[3], wire.servos[14]
        with closing(Bus(wire.port, BAUDRATE, P)) as bus:
            apply(bus, servo, inspect(bus, robot, servo).changes)
            assert inspect(bus, robot, servo).changes == ()
            degree = 1_003_846 / 360
            assert virtual.get("Min Position Limit") == pytest.approx(-(np.degrees(2.5) + 5) * degree, abs=2)
            virtual.position += 20 * degree
            state = read_states(bus, robot)[3]
            assert state.position == pytest.approx(read_angle(bus, servo), abs=1e-4) and state.voltage == 24
            calibrate(bus, robot, servo)
            assert read_angle(bus, servo) == pytest.approx(servo.mark, abs=1e-4)
        assert servos("id", 14, 114, "--port", wire.port, "--baudrate", BAUDRATE) == 0
        assert wire.servos[114] is virtual
