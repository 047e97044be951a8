"""A robot with an arm on each of two serial ports."""

from dataclasses import replace

import numpy as np
import pytest
import yaml
from servo_bus import RecordingWire

from gesture_bot.base.errors import InvalidValueError, PortError
from gesture_bot.base.files import config_dir
from gesture_bot.base.trajectory import JointTrajectory
from gesture_bot.cli.main import main
from gesture_bot.retarget.robot import load_robot
from gesture_bot.servo.driver import Driver
from gesture_bot.servo.simulated_line import SimulatedClock, SimulatedLine, SimulatedPort
from gesture_bot.servo.virtual_bus import VirtualBus, servo_specs
from gesture_bot.servo.virtual_servo import VirtualServo

TOA = load_robot("toa")
TOA_FILE = config_dir() / "robots" / "toa.yaml"
DT, T0 = 0.01, 1000.0
P_SERVO = "PM54-060-S250"


def two_armed():
    """toa with its right arm on a bus of its own, on servos of the P series."""
    slow = np.array([joint.startswith("right") for joint in TOA.joints])
    velocity = np.where(slow, np.minimum(TOA.limits.velocity, 3.0), TOA.limits.velocity)
    servos = tuple(
        replace(servo, bus="right", model=P_SERVO) if is_right else replace(servo, bus="left")
        for servo, is_right in zip(TOA.servos, slow, strict=True)
    )
    bus = TOA.bus.model_copy(update={"lag_ms": 45.0, "on_exit": "off"})
    return replace(TOA, servos=servos, bus=bus, limits=replace(TOA.limits, velocity=velocity))


ROBOT = two_armed()
ELBOWS = [ROBOT.joints.index(joint) for joint in ("left_elbow", "right_elbow")]


@pytest.fixture
def lines():
    clock = SimulatedClock()
    return {
        name: SimulatedLine(
            RecordingWire(map(VirtualServo, servo_specs(ROBOT, name))), ROBOT.bus.baudrate, clock
        )
        for name in ROBOT.buses
    }


@pytest.fixture
def driver(lines):
    driver = Driver(ROBOT, {name: SimulatedPort(line) for name, line in lines.items()})
    driver.start()
    yield driver
    driver.close()


def run(driver, seconds, start=T0):
    began, feedback = driver.clock.monotonic(), []
    for k in range(round(seconds / DT)):
        driver.clock.sleep(max(began + k * DT - driver.clock.monotonic(), 0))
        feedback.append(driver.tick(start + k * DT))
    return feedback


def both_elbows(*angles, seconds=0.5, start=T0):
    times = start + seconds * np.arange(len(angles))
    positions = ROBOT.rest[ELBOWS] + np.array(angles, float)[:, None]
    return JointTrajectory(("left_elbow", "right_elbow"), times, positions, np.zeros_like(positions))


def test_joints_of_both_buses_and_series_move_together(driver, lines):
    driver.set_trajectory(both_elbows(0.0, 0.6))
    feedback = run(driver, 0.8)
    elbows = np.array([f.positions[ELBOWS] for f in feedback])
    assert elbows[-1] == pytest.approx(ROBOT.rest[ELBOWS] + 0.6, abs=3e-3)
    assert np.abs(elbows[:, 0] - elbows[:, 1]).max() < 0.02, "one trajectory, one time"
    assert all(f.prompt for f in feedback) and driver.status.read_failures == 0
    ids = {name: {written[0] for written in line.wire.writes} for name, line in lines.items()}
    assert ids == {name: {s.id for s in ROBOT.servos if s.bus == name} for name in ("left", "right")}
    assert {health.voltage for health in driver.status.health.values()} == {12.0, 24.0}


def test_a_port_that_vanishes_stops_both_arms_and_they_are_eased_in_when_it_is_back(driver, lines):
    driver.set_trajectory(both_elbows(0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, seconds=1.0))
    run(driver, 0.5)
    lines["right"].connected = False
    with pytest.raises(PortError, match="vanished"):
        driver.tick(T0 + 0.5)
    servos = [lines[servo.bus].wire.servos[servo.id] for servo in (ROBOT.servos[joint] for joint in ELBOWS)]
    driver.clock.sleep(0.4)
    stood = [servo.position for servo in servos]
    driver.clock.sleep(0.4)
    assert [servo.position for servo in servos] == pytest.approx(stood, abs=0.5), (
        "by their watchdogs, the one with a good cable too"
    )
    lines["right"].connected = True
    feedback = run(driver, 1.5, T0 + 1.3)
    assert driver.status.ports_lost == 1 and driver.status.out == {}
    assert max(np.abs(f.velocities[ELBOWS]).max() for f in feedback[:8]) < 0.8, "eased in"
    off = feedback[-1].positions - feedback[-1].planned
    assert np.abs(off[ELBOWS]).max() < 0.06, "and then it is on its plan again"


def test_a_cable_without_power_on_one_bus_makes_all_hold_until_it_is_plugged_in(driver, lines):
    driver.set_trajectory(both_elbows(0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, seconds=1.0))
    run(driver, 0.5)
    right = lines["right"].wire.servos.values()
    for servo in right:
        servo.power = False
    feedback = run(driver, 1.0, T0 + 0.5)
    assert len(driver.status.silent) == len(right) and driver.status.holding
    assert np.ptp([f.positions[ELBOWS[0]] for f in feedback[-30:]]) < 3e-3
    for servo in right:
        servo.reboot()
    run(driver, 1.5, T0 + 1.5)
    assert driver.status.out == {} and not driver.status.holding


@pytest.mark.parametrize(
    ("port", "words"),
    [
        ("/dev/ttyUSB0", "several buses: write NAME=PORT, not: '/dev/ttyUSB0'; valid: left, right"),
        ("left=/dev/a tail=/dev/b", "toa has no bus: 'tail'; valid: left, right"),
        ("left=/dev/a", "NAME=PORT for each bus, also for: 'right'; valid: left, right"),
        ("left=/dev/a right=/dev/a", "twice there is: 'right=/dev/a'"),
    ],
)
def test_ports_that_do_not_fit_the_buses_are_refused(port, words):
    with pytest.raises(InvalidValueError, match=words):
        Driver(ROBOT, port)


def test_the_virtual_bus_has_a_port_for_each_and_the_commands_take_them(tmp_path, capsys):
    path = tmp_path / "two.yaml"
    description = yaml.safe_load(TOA_FILE.read_text())
    description["urdf"] = str(TOA_FILE.with_name("toa.urdf"))
    for name, joint in description["joints"].items():
        joint |= {"bus": "right", "model": P_SERVO, "velocity": 3.0} if "right" in name else {"bus": "left"}
    path.write_text(yaml.safe_dump(description, sort_keys=False))
    with VirtualBus(load_robot(str(path))) as bus:
        names = [word.partition("=")[0] for word in bus.port.split()]
        assert names == ["left", "right"]
        assert main(["servos", "check", str(path), "--apply", "--port", bus.port]) == 0
        assert main(["servos", "check", str(path), "--port", bus.port]) == 0
        assert "all servos are as the robot needs them" in capsys.readouterr().out
        assert main(["servos", "check", str(path), "--port", bus.port.split()[0]]) == 1
        assert "also for: 'right'; valid: left, right" in capsys.readouterr().err
