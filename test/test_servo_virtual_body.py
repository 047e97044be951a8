"""The robot's body in MuJoCo behind its virtual servos, as their registers show it."""

import numpy as np
import pytest
from conftest import wait_until
from dynamixel_sdk import PortHandler, Protocol2PacketHandler
from servo_bus import RecordingWire, shown

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.retarget.robot import load_robot
from gesture_bot.servo.models import signed
from gesture_bot.servo.table import ServoTable
from gesture_bot.servo.virtual_body import Body
from gesture_bot.servo.virtual_bus import VirtualBus, servo_specs
from gesture_bot.servo.virtual_servo import VirtualServo

ROBOT = load_robot("toa")
TABLE = ServoTable(ROBOT)
ROLL = ROBOT.joints.index("left_shoulder_roll")


@pytest.fixture
def wire():
    specs = servo_specs(ROBOT)
    body = Body(ROBOT.name, ROBOT.urdf, specs)
    return RecordingWire(VirtualServo(spec, body.joint(spec)) for spec in specs)


def servos(wire):
    return [wire.servos[row.id] for row in ROBOT.servos]


def let_pass(wire, seconds):
    """Angles (t, j) [rad] and velocities [rad/s], as the registers show them, each 10 ms."""
    angles, velocities = [], []
    for _ in range(round(seconds / 0.01)):
        wire.advance(0.01)
        registers = [
            (shown(s, "Present Position"), signed(shown(s, "Present Velocity"), 4)) for s in servos(wire)
        ]
        ticks, speeds = np.array(registers).T
        angles.append(TABLE.positions(ticks))
        velocities.append(speeds * 0.229 * 2 * np.pi / 60)
    return np.array(angles), np.array(velocities)


def hold(wire, roll, speed=2.0):
    """All joints at rest, but for the left arm, which goes out to the side with this speed [rad/s]."""
    target = ROBOT.rest.copy()
    target[ROLL] = roll
    unit = 0.229 * 2 * np.pi / 60
    for servo, ticks in zip(servos(wire), TABLE.ticks(target), strict=True):
        servo.set("Profile Velocity", round(speed / unit))
        servo.set("Profile Acceleration", round(8.0 / (214.577 * 2 * np.pi / 3600)))
        servo.set("Goal Position", int(ticks))
        servo.set("Torque Enable", 1)


def test_an_arm_goes_to_its_goal_no_faster_than_it_may_sags_and_falls_without_torque(wire):
    hold(wire, 1.5)
    angles, velocities = let_pass(wire, 2.0)
    assert np.abs(velocities[:, ROLL]).max() == pytest.approx(2.0, rel=0.08)
    sag = 1.5 - angles[-1, ROLL]
    assert 0.01 < sag < 0.06, "stretched out, it hangs a little below its goal"
    servo = servos(wire)[ROLL]
    effort = signed(shown(servo, "Present Current"), 2) * servo.model.effort_unit
    # Its weight, about 0.6 kg, at about half its length.
    assert 0.5 < effort < 1.5
    assert effort == pytest.approx(sag * 3.68 * servo.model.torque, rel=0.15), "by its stiffness"
    others = np.arange(len(ROBOT.joints)) != ROLL
    assert np.abs(angles[-1] - ROBOT.rest)[others].max() < 0.03

    servo.set("Torque Enable", 0)
    angles, velocities = let_pass(wire, 1.5)
    assert angles[-1, ROLL] < 0.3, "it hangs down"
    assert np.abs(velocities[:, ROLL]).max() > 3.0, "it fell"
    assert shown(servo, "Present Current") == 0


def test_a_weak_servo_does_not_lift_its_arm(wire):
    servos(wire)[ROLL].set("Goal PWM", 60)  # 7% of the stall torque
    hold(wire, 1.5)
    angles, _ = let_pass(wire, 2.0)
    assert 0.2 < angles[-1, ROLL] < 1.2


def test_a_joint_that_is_stuck_or_moved_by_hand_stays_where_it_is_put(wire):
    hold(wire, 0.5)
    let_pass(wire, 0.5)
    servo = servos(wire)[ROLL]
    servo.position += ROBOT.servos[ROLL].direction * 0.4 * servo.model.ticks_per_radian
    servo.stuck = True
    angles, _ = let_pass(wire, 1.0)
    assert np.ptp(angles[:, ROLL]) < 0.003 and angles[-1, ROLL] > 0.8
    assert (
        abs(signed(shown(servo, "Present Current"), 2)) * servo.model.effort_unit > 0.3 * servo.model.torque
    )
    servo.stuck = False
    angles, _ = let_pass(wire, 1.0)
    assert angles[-1, ROLL] == pytest.approx(0.5, abs=0.05)


def test_the_virtual_bus_serves_a_body():
    with pytest.raises(InvalidValueError, match="'ode'; valid: first_order, mujoco"):
        VirtualBus(ROBOT, "ode")
    sdk = Protocol2PacketHandler()
    with VirtualBus(ROBOT, "mujoco") as bus:
        port = PortHandler(bus.port)
        assert port.openPort()
        row = ROBOT.servos[ROLL]
        rest = TABLE.ticks(ROBOT.rest)[ROLL]
        hanging = TABLE.ticks(np.zeros(len(ROBOT.joints)))[ROLL]

        def falls():
            position, _, _ = sdk.read4ByteTxRx(port, row.id, 132)
            return 0 < abs(position - hanging) < abs(rest - hanging)

        wait_until(falls, 10, "the arm, which has no torque, to begin to fall")
        port.closePort()
