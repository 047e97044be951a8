"""The driver on a virtual bus: what reaches the servos, what comes back, and what happens in trouble."""

import signal
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from servo_bus import recorded_bus, simulated_bus

from gesture_bot.base.errors import BusError, InvalidValueError, RobotError
from gesture_bot.base.trajectory import JointTrajectory
from gesture_bot.evaluate.lag import motion_lag
from gesture_bot.retarget.robot import load_robot
from gesture_bot.servo import latency_timer
from gesture_bot.servo.arbitration import load_arbitration
from gesture_bot.servo.bus import Bus
from gesture_bot.servo.driver import Driver
from gesture_bot.servo.health import read_health
from gesture_bot.servo.models import WATCHDOG_ERROR, X, find_model, signed
from gesture_bot.servo.mux import MotionMux
from gesture_bot.servo.present import PresentReader
from gesture_bot.servo.simulated_line import SimulatedLine
from gesture_bot.servo.table import PRESENT, ServoTable
from gesture_bot.servo.virtual_bus import VirtualBus
from gesture_bot.servo.virtual_servo import BANDWIDTH, ServoSpec, VirtualServo

pytestmark = pytest.mark.live

ROBOT = load_robot("toa")
ROBOT = replace(ROBOT, bus=ROBOT.bus.model_copy(update={"lag_ms": 0.0}))
ELBOW = ROBOT.joints.index("left_elbow")
ELBOW_ID = ROBOT.servos[ELBOW].id
DT = 0.01
T0 = 1000.0


def robot_with(**bus):
    return replace(ROBOT, bus=ROBOT.bus.model_copy(update=bus))


@pytest.fixture
def wire():
    return simulated_bus(ROBOT)


@pytest.fixture
def terminal():
    """A bus behind a pseudo-terminal, in real time."""
    with recorded_bus(ROBOT) as wire:
        yield wire


@pytest.fixture
def driver(wire):
    driver = Driver(robot_with(on_exit="off"), wire.port)
    driver.start()
    yield driver
    driver.close()


def run(driver, seconds, start=T0):
    """Tick on time; returns the feedback of each tick."""
    began = driver.clock.monotonic()
    feedback = []
    for k in range(round(seconds / DT)):
        driver.clock.sleep(max(began + k * DT - driver.clock.monotonic(), 0))
        feedback.append(driver.tick(start + k * DT))
    return feedback


def elbow_path(*angles, seconds=0.5):
    """The left elbow alone, from angle to angle, at rest in each."""
    times = T0 + seconds * np.arange(len(angles))
    positions = np.array(angles, float)[:, None]
    return JointTrajectory(("left_elbow",), times, positions, np.zeros_like(positions))


def sent_angles(wire, joint):
    """All goals that a joint's servo got [rad]."""
    row = ROBOT.servos[joint]
    goals = np.array([signed(goal, 4) for goal in wire.written(row.id, "Goal Position")])
    return row.direction * ((goals - 2048) * 2 * np.pi / 4096 - row.offset)


def test_torque_comes_on_where_the_joints_are(wire):
    # Somebody has moved the arm, and the servos remember other goals and settings.
    elbow = wire.servos[ELBOW_ID]
    elbow.position = 2222.0
    elbow.set("Operating Mode", 1)
    elbow.set("Drive Mode", 4)
    driver = Driver(robot_with(on_exit="off"), wire.port)
    driver.start()
    registers = elbow.model.table
    order = [address for servo_id, address, _ in wire.writes if servo_id == ELBOW_ID]
    on = max(i for i, address in enumerate(order) if address == registers["Torque Enable"].address)
    assert wire.written(ELBOW_ID, "Torque Enable") == [0, 1]
    assert wire.written(ELBOW_ID, "Operating Mode") == [3]
    assert wire.written(ELBOW_ID, "Drive Mode") == [0]
    assert wire.written(ELBOW_ID, "Goal Position") == [2222]
    assert order.index(registers["Goal Position"].address) < on
    assert elbow.get("Bus Watchdog") == 10, "200 ms in units of 20 ms"
    assert elbow.get("Return Delay Time") == 0
    assert elbow.get("Profile Velocity") * 0.229 * 2 * np.pi / 60 == pytest.approx(
        ROBOT.limits.velocity[ELBOW], abs=0.03
    )
    driver.close()
    assert elbow.get("Torque Enable") == 0


def test_settings_that_are_right_are_not_written_again(wire, driver):
    driver.close()
    wire.writes.clear()
    driver.start()
    assert wire.written(ELBOW_ID, "Return Delay Time") == []


def test_an_arm_that_hangs_down_goes_to_its_first_target_slowly(wire):
    row = ROBOT.servos[ELBOW]
    wire.servos[row.id].position -= row.direction * 300  # 0.46 rad
    driver = Driver(robot_with(on_exit="off"), wire.port)
    driver.start()
    driver.set_trajectory(elbow_path(ROBOT.rest[ELBOW]))
    speeds = [feedback.velocities[ELBOW] for feedback in run(driver, 0.4)]
    driver.close()
    assert 0.4 < max(speeds) < 0.6


def test_joints_move_to_the_goal_and_report_it(driver, wire):
    rest = ROBOT.rest[ELBOW]
    driver.set_trajectory(elbow_path(rest, rest + 0.5))
    feedback = run(driver, 0.9)
    assert feedback[0].positions == pytest.approx(ROBOT.rest, abs=2e-3)
    assert feedback[-1].positions[ELBOW] == pytest.approx(rest + 0.5, abs=2e-3)
    others = np.arange(len(ROBOT.joints)) != ELBOW
    assert feedback[-1].positions[others] == pytest.approx(ROBOT.rest[others], abs=2e-3)
    assert feedback[-1].stamp == pytest.approx(T0 + 0.89, abs=0.01)
    fastest = max(feedback, key=lambda f: f.velocities[ELBOW])
    assert fastest.velocities[ELBOW] == pytest.approx(1.5, abs=0.3)
    assert max(f.efforts[ELBOW] for f in feedback) > 0.05
    assert driver.status.cycles == 90
    assert driver.status.read_failures == 0
    assert driver.status.command_age == pytest.approx(0.89)
    assert driver.status.interventions.position == driver.status.interventions.velocity == 0
    assert len(driver.status.health) >= 6
    for health in driver.status.health.values():
        assert health.temperature == pytest.approx(25, abs=1)
        assert (health.voltage, health.errors, health.torque) == (12.0, (), True)


@pytest.mark.parametrize(("lag_ms", "left"), [(0.0, 2 / BANDWIDTH + DT), (45.0, 0.0)])
def test_goals_are_sent_ahead_of_the_servos_lag(wire, lag_ms, left):
    driver = Driver(robot_with(on_exit="off", lag_ms=lag_ms), wire.port)
    driver.start()
    clock = driver.clock
    begin = clock.monotonic()
    plan_times = begin + np.arange(-1.0, 5.0, 0.02)
    phase = 2 * np.pi * 0.7 * (plan_times - begin)[:, None]
    swing, speed = 0.8 - 0.3 * np.cos(phase), 0.3 * 2 * np.pi * 0.7 * np.sin(phase)
    driver.set_trajectory(JointTrajectory(("left_elbow",), plan_times, swing, speed))
    told = []
    while (now := clock.monotonic()) < begin + 3.5:
        told.append(driver.tick(now))
        clock.sleep(max(0.0, now + DT - clock.monotonic()))
    driver.close()
    times = np.array([feedback.stamp for feedback in told[100:]])
    measured = np.array([feedback.positions[[ELBOW]] for feedback in told[100:]])
    assert motion_lag(times, measured, plan_times, swing) == pytest.approx(left, abs=0.012)


def test_a_stop_brakes_evenly_also_where_goals_are_sent_ahead(wire):
    driver = Driver(robot_with(on_exit="off", lag_ms=45.0), wire.port)
    driver.start()
    mux = MotionMux(ROBOT.limits, ROBOT.rest, load_arbitration()[0])
    times = T0 + np.arange(0.0, 4.0, 0.02)
    swing = ROBOT.rest[ELBOW] + 0.5 - 0.5 * np.cos(2 * np.pi * 0.6 * (times - T0))
    speed = 0.5 * 2 * np.pi * 0.6 * np.sin(2 * np.pi * 0.6 * (times - T0))
    mux.set_source("gesture", JointTrajectory(("left_elbow",), times, swing[:, None], speed[:, None]), T0)
    for tick in range(250):
        now = T0 + tick * DT
        if tick == 205:  # in full swing
            wire.writes.clear()
            mux.stop()
            before = driver.status.interventions.acceleration
        if tick % 4 == 0:
            driver.set_trajectory(mux.tick(now))
        driver.tick(now)
        driver.clock.sleep(DT)
    acceleration = np.abs(np.diff(sent_angles(wire, ELBOW), 2)).max() / DT**2
    assert acceleration <= ROBOT.limits.acceleration[ELBOW] + 40  # a tick of the servo is 15 rad/s^2
    assert driver.status.interventions.acceleration - before < 12
    driver.close()


def test_a_trajectory_that_asks_too_much_stays_inside_the_limits_on_the_bus(driver, wire):
    rest, limits = ROBOT.rest[ELBOW], ROBOT.limits
    wire.writes.clear()
    driver.set_trajectory(elbow_path(rest, 9.0, -9.0, rest, seconds=0.2))
    run(driver, 1.2)
    sent = sent_angles(wire, ELBOW)
    resolution = 2 * np.pi / 4096
    assert limits.lower[ELBOW] - resolution <= sent.min() <= sent.max() <= limits.upper[ELBOW] + resolution
    assert np.abs(np.diff(sent)).max() / DT <= limits.velocity[ELBOW] + resolution / DT
    assert np.abs(np.diff(sent, 2)).max() / DT**2 <= limits.acceleration[ELBOW] + 2 * resolution / DT**2
    assert driver.status.interventions.position > 0


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"joints": ("left_tail",)}, "left_tail.*valid: left_shoulder_pitch"),
        ({"positions": np.array([[0.4], [np.nan]])}, "positions must be finite numbers: nan"),
        ({"velocities": np.array([[0.0], [np.inf]])}, "velocities must be finite numbers: inf"),
        ({"times": np.array([T0, T0])}, "times must increase"),
        ({"times": np.array([T0, np.nan])}, "times must be finite numbers: nan"),
        ({"positions": np.zeros((2, 3))}, "wrong shape"),
        ({"times": np.array([])}, "no point"),
    ],
)
def test_a_bad_trajectory_is_refused_and_the_last_one_goes_on(driver, change, words):
    rest = ROBOT.rest[ELBOW]
    driver.set_trajectory(elbow_path(rest, rest + 0.2, seconds=0.2))
    run(driver, 0.1)
    with pytest.raises(InvalidValueError, match=words):
        driver.set_trajectory(replace(elbow_path(0.0, 1.0), **change))
    feedback = run(driver, 0.25, T0 + 0.1)
    assert feedback[-1].positions[ELBOW] == pytest.approx(rest + 0.2, abs=5e-3)


def test_when_commands_end_in_motion_the_joint_brakes(driver, wire):
    rest = ROBOT.rest[ELBOW]
    moving = replace(elbow_path(rest, rest + 0.3, seconds=0.3), velocities=np.array([[0.0], [2.0]]))
    driver.set_trajectory(moving)
    run(driver, 0.8)
    sent = sent_angles(wire, ELBOW)
    assert (np.diff(sent) > -2e-3).all(), "it goes on a little, and never back"
    assert rest + 0.3 < sent[-1] < rest + 0.6
    assert np.abs(np.diff(sent, 2)).max() / DT**2 <= ROBOT.limits.acceleration[ELBOW] + 2 * 0.0016 / DT**2


def test_the_servos_stop_by_themselves_when_nobody_ticks(driver, wire):
    rest, elbow = ROBOT.rest[ELBOW], wire.servos[ELBOW_ID]
    driver.set_trajectory(elbow_path(rest, rest + 1.0, seconds=2.0))
    run(driver, 0.8)
    driver.clock.sleep(0.5)
    assert elbow.get("Bus Watchdog") == WATCHDOG_ERROR
    where = elbow.position
    driver.clock.sleep(0.1)
    assert elbow.position == pytest.approx(where, abs=1)
    feedback = run(driver, 1.0, T0 + 2.0)
    assert driver.status.watchdog_stops == 1
    assert driver.status.late_cycles >= 1
    assert elbow.get("Bus Watchdog") == 10
    assert max(abs(f.velocities[ELBOW]) for f in feedback) < 0.6, "eased back in"


def test_a_silent_servo_makes_the_robot_hold_until_it_is_back(driver, wire):
    rest = ROBOT.rest[ELBOW]
    driver.set_trajectory(elbow_path(rest, rest + 1.0, seconds=3.0))
    run(driver, 0.3)
    gone = wire.servos.pop(31)
    feedback = run(driver, 0.6, T0 + 0.3)
    assert driver.status.silent == ("head_pan",)
    assert driver.status.read_failures >= 5
    assert np.ptp([f.positions[ELBOW] for f in feedback[-20:]]) < 3e-3, "the others hold, and are still read"
    gone.reboot()
    wire.servos[31] = gone
    feedback = run(driver, 1.2, T0 + 0.9)
    assert driver.status.silent == ()
    assert gone.get("Torque Enable") == 1
    assert feedback[-1].positions[ELBOW] > feedback[0].positions[ELBOW] + 0.1


def test_an_answer_that_comes_too_late_is_not_taken_for_the_next(terminal, monkeypatch):
    answer = VirtualServo.read

    def slowly(servo, address, size):
        if address == torque:
            time.sleep(0.017)  # longer than a cycle waits
        return answer(servo, address, size)

    torque, present = X.registers["Torque Enable"].address, X.registers["Present Load"].address
    bus = Bus(terminal.port, ROBOT.bus.baudrate)
    read = bus.try_read(ELBOW_ID, present, PRESENT.itemsize)
    assert len(read) == PRESENT.itemsize
    bus.hurry()
    monkeypatch.setattr(VirtualServo, "read", slowly)
    assert read_health(bus, ELBOW_ID, find_model("XL430-W250")) is None
    answers = {bus.try_read(ELBOW_ID, present, PRESENT.itemsize) for _ in range(5)}
    assert answers in ({read}, {b"", read})
    bus.close()


def test_a_state_whose_moment_is_not_known_is_told(monkeypatch):
    wire = simulated_bus(ROBOT)
    driver, elbow, late = Driver(robot_with(on_exit="off"), wire.port), wire.servos[ELBOW_ID], False
    answer = elbow.read

    def answer_late(address, size):
        wire.port.clock.sleep(0.006 if late else 0.0)
        return answer(address, size)

    driver.start()
    monkeypatch.setattr(elbow, "read", answer_late)
    for k in range(100):
        late = k % 10 == 9
        assert driver.tick(T0 + k * DT).prompt == (not late)
    assert driver.status.late_answers == 10
    driver.close()


@pytest.mark.parametrize("pause", [0.03, 0.3])
def test_stamps_are_right_where_the_thread_pauses_or_the_clock_is_set(pause):
    wire = simulated_bus(ROBOT)
    driver, begin = Driver(robot_with(on_exit="off"), wire.port), T0
    driver.start()
    clock, started = driver.clock, driver.clock.monotonic()
    for k in range(30):
        begin -= 5.0 * (k == 20)
        since = clock.monotonic()
        now = begin + since - started
        clock.sleep(pause if k % 10 == 5 else 0.0)
        stamp = driver.tick(now, since).stamp
        assert stamp == pytest.approx(begin + clock.monotonic() - started, abs=DT)
        clock.sleep(DT)
    driver.close()


def test_a_state_in_which_a_servo_did_not_answer_is_told():
    wire = simulated_bus(ROBOT)
    driver = Driver(robot_with(on_exit="off"), wire.port)
    driver.start()
    told = []
    for k in range(40):
        wire.faults.silent = {ELBOW_ID} if 10 <= k < 12 or k >= 20 else set()
        told.append(driver.tick(T0 + k * DT).prompt)
    assert not any(told[10:12]), "its position is an old one"
    assert all(told[14:20])
    assert driver.status.silent and told[-1], (
        "one that is gone is said to be, and the others' states are told"
    )
    driver.close()


def test_a_bus_that_hangs_for_a_moment_costs_no_servo_its_place(monkeypatch):
    """As a busy USB controller does, or a virtual bus whose process waits for its turn."""
    wire = simulated_bus(ROBOT)
    driver = Driver(robot_with(on_exit="off"), wire.port)
    driver.start()
    read, busy = VirtualServo.read, False

    def answer(servo, address, size):
        wire.port.clock.sleep(0.0012 if busy else 0.0)
        return read(servo, address, size)

    monkeypatch.setattr(VirtualServo, "read", answer)
    driver.set_trajectory(elbow_path(0.0, 1.0, 0.0, 1.0, seconds=0.5))
    out, held = [], []
    for k in range(60):
        wire.faults.lost_replies = float(10 <= k < 22)
        busy = 22 <= k < 25
        feedback = driver.tick(T0 + k * DT)
        out.append(bool(driver.status.out))
        held.append(driver.status.holding)
    assert not any(out[:17]) and all(out[18:22]) and not any(out[26:])
    assert not any(held[:17]) and all(held[19:22]) and not any(held[27:])
    assert feedback.prompt and driver.status.blocks == 0
    wire.faults.silent = set(wire.servos)
    for k in range(60, 100):
        driver.tick(T0 + k * DT)
    wire.faults.silent.clear()
    driver.tick(T0 + 1.0)
    driver.tick(T0 + 1.0 + DT)
    assert set(driver.status.out) == set(ROBOT.joints), "after so long they are set up again, one by one"
    driver.close()


def test_a_virtual_bus_whose_process_waits_for_its_turn_needs_not_be_set_up_again():
    with VirtualBus(ROBOT) as bus:
        driver = Driver(robot_with(on_exit="off"), bus.port)
        driver.start()
        run(driver, 0.3)
        began = time.monotonic()
        try:
            bus.process.send_signal(signal.SIGSTOP)
            while (now := time.monotonic() - began) < 0.35:  # longer than a servo's watchdog
                driver.tick(T0 + now)
        finally:
            bus.process.send_signal(signal.SIGCONT)
        assert driver.status.holding
        feedback = run(driver, 0.1, T0 + 0.4)
        assert feedback[-1].prompt and not driver.status.out and not driver.status.holding
        run(driver, 1.0, T0 + 0.5)
        assert not driver.status.out, "its servos' watchdogs did not bite"
        driver.close()


def test_a_power_dip_of_the_whole_bus_is_no_hang(driver, wire):
    run(driver, 0.2)
    for servo in wire.servos.values():
        servo.power = False
    run(driver, 0.1, T0 + 0.2)
    for servo in wire.servos.values():
        servo.reboot()
    run(driver, 0.03, T0 + 0.3)
    assert driver.status.out == dict.fromkeys(ROBOT.joints, "was switched off and on")
    run(driver, 3.0, T0 + 0.4)
    assert not driver.status.out and not driver.status.holding


def test_a_servo_without_torque_is_not_taken_back_after_a_hang(driver, wire):
    run(driver, 0.2)
    wire.faults.lost_replies = 1.0
    run(driver, 0.1, T0 + 0.2)
    wire.servos[ELBOW_ID].set("Torque Enable", 0)
    wire.faults.lost_replies = 0.0
    run(driver, 0.03, T0 + 0.3)
    assert driver.status.out == {"left_elbow": "was switched off and on"}


def test_an_answer_that_came_while_the_thread_paused_is_in_time(wire, monkeypatch):
    bus = Bus(wire.port, ROBOT.bus.baudrate)
    bus.hurry()
    read, pauses = SimulatedLine.read, iter([0.1])

    def paused(line, size):
        if pause := next(pauses, 0.0):
            line.clock.sleep(pause)
            return b""
        return read(line, size)

    monkeypatch.setattr(SimulatedLine, "read", paused)
    assert bus.try_read(ELBOW_ID, 0, 2)
    assert not bus.try_read(200, 0, 2)


def test_a_servo_that_does_not_tell_where_it_is_is_named():
    wire = simulated_bus(ROBOT)
    bus = Bus(wire.port, ROBOT.bus.baudrate)
    reader = PresentReader(bus, [servo.id for servo in ROBOT.servos])
    reader.read_all()
    wire.faults.silent.add(ELBOW_ID)
    with pytest.raises(BusError, match=f"stopped answering, IDs: \\[{ELBOW_ID}\\]"):
        reader.read_all()


def test_a_slow_usb_adapter_is_told(tmp_path, monkeypatch):
    with recorded_bus(ROBOT) as wire:
        driver = Driver(robot_with(on_exit="off"), wire.port)
        driver.start()
        assert driver.status.latency_timer is None, "a pseudo-terminal has no such timer"
        driver.close()
        timer = tmp_path / Path(wire.port).name / "latency_timer"
        timer.parent.mkdir()
        timer.write_text("16\n")
        monkeypatch.setattr(latency_timer, "DEVICES", tmp_path)
        driver.start()
        assert driver.status.latency_timer == 16
        driver.close()


def test_a_port_that_does_not_exist_is_named():
    with pytest.raises(BusError, match="cannot open the serial port: '/dev/ttyNONE'; valid: "):
        Driver(ROBOT, "/dev/ttyNONE").start()


def test_a_port_that_vanishes_is_named():
    with VirtualBus(ROBOT) as bus:
        driver = Driver(ROBOT, bus.port)
        driver.start()
        driver.tick(T0)
    with pytest.raises(BusError, match="the serial port has vanished: '/dev/pts"):
        driver.tick(T0 + DT)
    with pytest.raises(BusError, match="vanished"):
        driver.close()


def test_a_port_in_use_is_named(terminal):
    driver = Driver(robot_with(on_exit="off"), terminal.port)
    driver.start()
    with pytest.raises(BusError, match="another program uses the serial port"):
        Driver(ROBOT, terminal.port).start()
    driver.tick(T0)
    driver.close()


def test_a_missing_servo_is_named_with_those_found(wire):
    del wire.servos[ELBOW_ID]
    with pytest.raises(BusError, match=r"left_elbow.*14; valid: 11, 12, 13, 15"):
        Driver(ROBOT, wire.port).start()


def test_a_servo_of_another_model_is_named(wire):
    wire.servos[ELBOW_ID] = VirtualServo(ServoSpec(ELBOW_ID, "XM430-W350"))
    with pytest.raises(BusError, match="servo 14 of left_elbow.*'XM430-W350'; valid: XL430-W250"):
        Driver(ROBOT, wire.port).start()


def test_a_servo_in_need_of_help_is_named(wire):
    wire.servos[ELBOW_ID].set("Hardware Error Status", 1 << 2)
    with pytest.raises(BusError, match="left_elbow reports overheating"):
        Driver(ROBOT, wire.port).start()


def test_a_servo_that_cannot_reach_the_joints_range_is_named(wire):
    wire.servos[ELBOW_ID].set("Max Position Limit", 2100)
    wire.servos[ELBOW_ID].set("Min Position Limit", 2000)
    with pytest.raises(BusError, match="2000 to 2100; left_elbow needs"):
        Driver(ROBOT, wire.port).start()


def test_an_unknown_model_in_the_servo_table_is_named():
    servos = (replace(ROBOT.servos[0], model="AX-12"), *ROBOT.servos[1:])
    with pytest.raises(RobotError, match="'AX-12'; valid: XL330-M077"):
        Driver(replace(ROBOT, servos=servos), "/dev/null")


@pytest.mark.parametrize("on_exit", ["rest_then_off", "hold", "off"])
def test_exit(wire, on_exit):
    driver = Driver(robot_with(on_exit=on_exit), wire.port)
    driver.start()
    rest, elbow = ROBOT.rest[ELBOW], wire.servos[ELBOW_ID]
    driver.set_trajectory(elbow_path(rest, rest + 0.6, seconds=0.4))
    run(driver, 0.5)
    wire.writes.clear()
    began = driver.clock.monotonic()
    driver.close()
    assert driver.clock.monotonic() - began < 1.5
    assert elbow.get("Bus Watchdog") == 0
    assert elbow.get("Torque Enable") == (on_exit == "hold")
    home = ServoTable(ROBOT).ticks(ROBOT.rest)[ELBOW]
    if on_exit == "rest_then_off":
        assert elbow.position == pytest.approx(home, abs=10)
        sent = sent_angles(wire, ELBOW)
        assert np.abs(np.diff(sent, 2)).max() / DT**2 <= ROBOT.limits.acceleration[ELBOW] + 2 * 0.0016 / DT**2
    else:
        assert abs(elbow.position - home) > 300
    driver.close()


def test_ticks_before_the_start_are_refused():
    with pytest.raises(BusError, match="not started"):
        Driver(ROBOT, "/dev/null").tick(T0)


def swinging(wire, **bus):
    """A driver in the middle of a long swing of the left elbow."""
    driver = Driver(robot_with(on_exit="off", **bus), wire.port)
    driver.start()
    rest = ROBOT.rest[ELBOW]
    driver.set_trajectory(elbow_path(*[rest, rest + 0.8] * 20, seconds=0.6))
    run(driver, 0.85)
    return driver


@pytest.mark.parametrize("on_stop", ["hold", "relax"])
def test_a_stop_brakes_in_the_next_cycle_and_latches_whatever_is_planned(wire, on_stop):
    driver = swinging(wire, on_stop=on_stop)
    wire.writes.clear()
    driver.stop()
    feedback = run(driver, 1.0, T0 + 0.85)
    speeds = np.diff(sent_angles(wire, ELBOW)) / DT
    limit, tick = ROBOT.limits.acceleration[ELBOW], 0.0016 / DT
    assert abs(speeds[0]) > 1.0, "it was in full swing"
    assert abs(speeds[1]) < abs(speeds[0]) - 0.5 * limit * DT
    assert (np.diff(np.abs(speeds)) <= tick).all(), "it only ever slows"
    assert np.abs(np.diff(speeds)).max() / DT <= limit + 2 * tick / DT
    assert abs(feedback[30].velocities[ELBOW]) < 0.05
    assert {wire.servos[row.id].get("Torque Enable") for row in ROBOT.servos} == {int(on_stop == "hold")}
    assert driver.status.holding and driver.status.relaxed == (on_stop == "relax")
    assert driver.status.out == {}
    driver.close()


def test_relaxed_arms_are_moved_by_hand_and_eased_back_in_from_where_they_are(wire):
    driver = swinging(wire, on_stop="relax")
    elbow, row = wire.servos[ELBOW_ID], ROBOT.servos[ELBOW]
    driver.stop()
    run(driver, 1.0, T0 + 0.85)
    elbow.position += row.direction * 400  # 0.61 rad
    moved = run(driver, 0.5, T0 + 1.85)[-1].positions
    assert elbow.get("Torque Enable") == 0
    wire.writes.clear()
    driver.reset()
    standing = run(driver, 1.0, T0 + 2.35)
    assert np.abs(np.diff([feedback.positions for feedback in standing], axis=0)).max() < 0.01
    feedback = standing + run(driver, 6.0, T0 + 3.35)
    assert {wire.servos[servo.id].get("Torque Enable") for servo in ROBOT.servos} == {1}
    # The goal was where the hand had left the joint before torque came on.
    registers = elbow.model.table
    order = [(address, data) for servo_id, address, data in wire.writes if servo_id == ELBOW_ID]
    on = order.index((registers["Torque Enable"].address, b"\x01"))
    goals = [data for address, data in order[:on] if address == registers["Goal Position"].address]
    assert [int.from_bytes(goal, "little") for goal in goals] == pytest.approx(
        [2048 + (row.direction * moved[ELBOW] + row.offset) * 4096 / 2 / np.pi], abs=1
    )
    assert not driver.status.relaxed and not driver.status.holding
    # It was eased to its plan, which it then follows again.
    speeds = np.abs([f.velocities[ELBOW] for f in feedback])
    met = int(np.argmax(speeds > 0.6))
    assert met > 100
    planned = np.array([f.planned[ELBOW] for f in feedback[-50:]])
    measured = np.array([f.positions[ELBOW] for f in feedback[-50:]])
    assert np.abs(planned - measured).max() < 0.2
    driver.close()


def test_a_servo_that_missed_the_stop_is_relaxed_when_it_is_heard_again(wire):
    driver = swinging(wire, on_stop="relax", on_fault="carry_on")
    elbow = wire.servos[ELBOW_ID]
    wire.faults.silent.add(ELBOW_ID)
    run(driver, 0.3, T0 + 0.85)
    driver.stop()
    run(driver, 1.0, T0 + 1.15)
    assert elbow.get("Torque Enable") == 1
    wire.faults.silent.clear()
    run(driver, 1.0, T0 + 2.15)
    assert elbow.get("Torque Enable") == 0
    driver.reset()
    run(driver, 4.0, T0 + 3.15)
    assert elbow.get("Torque Enable") == 1 and driver.status.out == {}
    driver.close()


def test_after_a_stop_the_exit_moves_nothing(wire):
    driver = swinging(wire)
    driver.close()
    driver = Driver(robot_with(on_exit="rest_then_off"), wire.port)
    driver.start()
    driver.stop()
    run(driver, 0.1)
    before = wire.servos[ELBOW_ID].position
    driver.close()
    assert wire.servos[ELBOW_ID].position == pytest.approx(before, abs=2)
    assert wire.servos[ELBOW_ID].get("Torque Enable") == 0


def test_inactive_joints_hold_and_take_up_only_what_is_planned_afterwards(wire):
    driver = swinging(wire)
    driver.deactivate()
    held = run(driver, 1.0, T0 + 0.85)
    assert np.ptp([feedback.positions for feedback in held[40:]], axis=0).max() < 2e-3
    driver.activate()
    still = run(driver, 0.5, T0 + 1.85)
    assert np.ptp([feedback.positions for feedback in still], axis=0).max() < 2e-3
    assert wire.servos[ELBOW_ID].get("Torque Enable") == 1
    target = replace(elbow_path(ROBOT.rest[ELBOW]), times=np.array([T0 + 2.35]))
    driver.set_trajectory(target)
    assert run(driver, 3.0, T0 + 2.35)[-1].positions[ELBOW] == pytest.approx(ROBOT.rest[ELBOW], abs=3e-3)
    driver.close()


def with_model(robot, model, velocity=2.5):
    """The same robot on other servos, whose joints are no faster than these [rad/s]."""
    servos = tuple(replace(servo, model=model) for servo in robot.servos)
    slower = replace(robot.limits, velocity=np.minimum(robot.limits.velocity, velocity))
    return replace(robot, servos=servos, limits=slower)


def test_the_p_series_is_driven_by_its_own_addresses_and_units():
    robot = with_model(robot_with(on_exit="off", lag_ms=45.0), "PH42-020-S300")
    wire = simulated_bus(robot)
    driver, elbow = Driver(robot, wire.port), wire.servos[ELBOW_ID]
    driver.start()
    rest = robot.rest[ELBOW]
    driver.set_trajectory(elbow_path(rest, rest + 0.8, rest + 0.8, rest, seconds=1.0))
    feedback = run(driver, 1.6)
    assert feedback[-1].positions[ELBOW] == pytest.approx(rest + 0.8, abs=1e-3)
    assert elbow.position == pytest.approx(-(rest + 0.8) * 607_500 / (2 * np.pi), abs=100), "0 is the middle"
    speeds = [f.velocities[ELBOW] for f in feedback]
    assert max(speeds) == pytest.approx(1.5 * 0.8, rel=0.05), "a cubic's fastest [rad/s]"
    assert int.from_bytes(elbow.memory[560:564], "little") == np.ceil(2.5 / (0.01 * 2 * np.pi / 60))
    assert elbow.memory[546] == robot.bus.watchdog_ms // 20
    elbow.stuck = True
    stuck = run(driver, 0.8, T0 + 1.6)
    assert driver.status.yielding == ("left_elbow",)
    assert min(f.efforts[ELBOW] for f in stuck) < -0.2 * 5.1, "[N m]"
    assert driver.status.health["left_elbow"].voltage == 24.0
    driver.close()
    assert elbow.get("Torque Enable") == 0


def test_one_bus_carries_one_series():
    servos = (*ROBOT.servos[:-1], replace(ROBOT.servos[-1], model="PM42-010-S260"))
    with pytest.raises(RobotError, match="one series: \\['P', 'X'\\]"):
        Driver(replace(ROBOT, servos=servos), "nowhere")
