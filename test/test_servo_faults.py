"""Faults on a virtual bus, with the real driver: what docs/faults.md promises."""

import os
import time
from dataclasses import replace

import numpy as np
import pytest
from servo_bus import recorded_bus, shown, simulated_bus

from gesture_bot.base.errors import BusError, PortError
from gesture_bot.base.trajectory import JointTrajectory
from gesture_bot.evaluate.faults import FAULTS, try_fault
from gesture_bot.retarget.robot import load_robot
from gesture_bot.servo.driver import REOPEN_PERIOD, Driver
from gesture_bot.servo.models import signed

ROBOT = load_robot("toa")
ROBOT = replace(ROBOT, bus=ROBOT.bus.model_copy(update={"lag_ms": 45.0, "on_exit": "off"}))
ELBOW = ROBOT.joints.index("left_elbow")
DT = 0.01
T0 = 1000.0


@pytest.fixture
def wire():
    return simulated_bus(ROBOT)


def started(wire, **bus):
    driver = Driver(replace(ROBOT, bus=ROBOT.bus.model_copy(update=bus)), wire.port)
    driver.start()
    return driver


def ticks(driver, seconds, start=T0):
    """Tick on time; yields the time since the first one, and the feedback."""
    began = driver.clock.monotonic()
    for k in range(round(seconds / DT)):
        driver.clock.sleep(max(began + k * DT - driver.clock.monotonic(), 0))
        yield k * DT, driver.tick(start + k * DT)


def swing(size, hertz, joints=ROBOT.joints, seconds=20.0):
    times = np.arange(0.0, seconds, 0.01)
    phase = 2 * np.pi * hertz * times[:, None]
    rest = ROBOT.rest[[ROBOT.joints.index(joint) for joint in joints]]
    positions = rest + 0.5 * size * (1 - np.cos(phase))
    velocities = np.broadcast_to(np.pi * hertz * size * np.sin(phase), positions.shape)
    return JointTrajectory(joints, T0 + times, positions, velocities)


@pytest.mark.parametrize(
    ("name", "on_fault"),
    [
        (name, mode)
        for name, fault in FAULTS.items()
        for mode in (("stop", "carry_on") if fault.stops else ("stop",))
    ],
)
def test_the_robot_survives(name, on_fault):
    outcome = try_fault(ROBOT, name, on_fault)
    assert outcome.failures == ()


def test_a_fault_that_is_not_survived_is_told(monkeypatch):
    monkeypatch.setattr("gesture_bot.servo.following.ERROR", 9.0)
    assert "it was not told of within 0.3 s" in try_fault(ROBOT, "stuck joint").failures


@pytest.mark.parametrize("lag_ms", [0.0, 45.0])
def test_the_fastest_motion_that_the_limits_allow_is_not_taken_for_a_blocked_joint(wire, lag_ms):
    driver = started(wire, lag_ms=lag_ms)
    random = np.random.default_rng(0)
    times = T0 + np.arange(0.0, 8.0, 0.15)
    targets = random.uniform(ROBOT.limits.lower, ROBOT.limits.upper, (len(times), len(ROBOT.joints)))
    targets[::3] = targets[1::3]  # with stops
    driver.set_trajectory(JointTrajectory(ROBOT.joints, times, targets, np.zeros_like(targets)))
    speeds = [np.abs(feedback.velocities) / ROBOT.limits.velocity for _, feedback in ticks(driver, 6.0)]
    assert np.max(speeds) > 0.95
    assert driver.status.blocks == 0 and driver.status.out == {}


def test_a_blocked_joint_stops_pressing_and_is_taken_along_slowly_once_it_is_free(wire):
    driver = started(wire)
    driver.set_trajectory(swing(0.8, 0.5, ("left_elbow",)))
    servo = wire.servos[ROBOT.servos[ELBOW].id]
    list(ticks(driver, 0.5))
    servo.stuck = True
    pressing = [
        (time, abs(signed(shown(servo, "Present Load"), 2))) for time, _ in ticks(driver, 1.5, T0 + 0.5)
    ]
    assert max(load for _, load in pressing) > 300
    assert max(load for time, load in pressing if time > 0.6) < 100, "of 1000"
    assert driver.status.yielding == ("left_elbow",)
    assert driver.status.blocks == 1
    servo.stuck = False
    driver.set_trajectory(
        JointTrajectory(("left_elbow",), np.array([T0 + 2.0]), ROBOT.rest[[[ELBOW]]] + 0.8, np.zeros((1, 1)))
    )
    speeds = [feedback.velocities[ELBOW] for _, feedback in ticks(driver, 3.0, T0 + 2.0)]
    assert driver.status.yielding == ()
    assert 0.3 < max(speeds) < 0.6


def test_a_warm_servo_slows_alone(wire):
    driver = started(wire)
    left, right = (ROBOT.joints.index(joint) for joint in ("left_elbow", "right_elbow"))
    wire.servos[ROBOT.servos[left].id].temperature = 66.0
    list(ticks(driver, 2.0))
    assert driver.status.warm == ("left_elbow",)
    driver.set_trajectory(
        replace(swing(0.5, 2.3, ("left_elbow", "right_elbow")), times=T0 + np.arange(2.0, 22.0, 0.01))
    )
    speeds = np.array([feedback.velocities for _, feedback in ticks(driver, 3.0, T0 + 2.0)])
    # It cools down to 65 degC meanwhile: 56% of 5 rad/s.
    assert 2.0 < np.abs(speeds[:, left]).max() < 3.0
    assert np.abs(speeds[:, right]).max() > 3.3
    assert not driver.status.holding


def test_a_servo_that_has_shut_itself_down_stays_out_until_it_is_rebooted(wire):
    driver = started(wire, on_fault="carry_on")
    driver.set_trajectory(swing(0.5, 0.5))
    list(ticks(driver, 1.0))
    servo = wire.servos[ROBOT.servos[ELBOW].id]
    servo.temperature = 75.0  # its Temperature Limit is 72
    list(ticks(driver, 2.0, T0 + 1.0))
    assert driver.status.out == {"left_elbow": "reports overheating"}
    servo.temperature = 30.0
    list(ticks(driver, 2.0, T0 + 3.0))
    assert servo.get("Torque Enable") == 0
    servo.reboot()
    list(ticks(driver, 3.0, T0 + 5.0))
    assert driver.status.out == {}
    assert servo.get("Torque Enable") == 1 and servo.get("Bus Watchdog") == 10


def test_a_port_is_opened_again_when_its_path_is_back(tmp_path):
    path = tmp_path / "ttyUSB0"
    with recorded_bus(ROBOT) as wire:
        path.symlink_to(wire.port)
        driver = Driver(ROBOT, str(path))
        driver.start()
        driver.tick(T0)
    with pytest.raises(PortError, match="vanished"):
        driver.tick(T0 + DT)
    with pytest.raises(PortError, match="vanished"):
        driver.tick(T0 + 2 * DT)
    time.sleep(REOPEN_PERIOD)
    with pytest.raises(BusError, match="cannot open"):
        driver.tick(T0 + 1.0)
    time.sleep(REOPEN_PERIOD)
    with recorded_bus(ROBOT) as wire:
        os.unlink(path)
        path.symlink_to(wire.port)
        feedback = driver.tick(T0 + 2.0)
        assert feedback.positions == pytest.approx(ROBOT.rest, abs=2e-3)
        assert driver.status.ports_lost == 1
        assert wire.servos[ROBOT.servos[ELBOW].id].get("Torque Enable") == 1
        driver.close()


def test_a_hot_joint_goes_to_rest_before_its_torque_goes_off(wire):
    driver = started(wire, on_fault="carry_on")
    driver.set_trajectory(swing(1.0, 0.2))
    list(ticks(driver, 2.0))
    servo = wire.servos[ROBOT.servos[ELBOW].id]
    servo.temperature = 71.0
    path = [
        (feedback.positions[ELBOW], servo.get("Torque Enable"))
        for _, feedback in ticks(driver, 4.0, T0 + 2.0)
    ]
    positions, torque = np.array(path).T
    assert positions[0] > ROBOT.rest[ELBOW] + 0.5
    assert positions[torque == 1][-1] == pytest.approx(ROBOT.rest[ELBOW], abs=0.03)
    assert torque[-1] == 0
    assert driver.status.out == {"left_elbow": "is hot"}
