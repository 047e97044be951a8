"""The nodes around the servos, as their topics and services, and the packets on the bus, show them."""

import numpy as np
import pytest
from conftest import wait_until
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
from moving_robot import spun
from rcl_interfaces.msg import Log
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from servo_bus import recorded_bus
from std_msgs.msg import Bool
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory as JointTrajectoryMessage

from gesture_bot.base.errors import BusError
from gesture_bot.base.trajectory import JointTrajectory
from gesture_bot.nodes.messages import trajectory_to
from gesture_bot.nodes.motion_mux import MotionMux
from gesture_bot.nodes.node import PLAN, seconds
from gesture_bot.nodes.servo_driver import ServoDriver
from gesture_bot.retarget.robot import load_robot
from gesture_bot.servo.bus import Bus
from gesture_bot.servo.models import signed

pytestmark = pytest.mark.live

ROBOT = load_robot("toa")
JOINT = ROBOT.joints.index("head_pan")
SERVO = ROBOT.servos[JOINT]
TICK = 2 * np.pi / 4096


@pytest.fixture
def wire():
    with recorded_bus(ROBOT) as wire:
        yield wire


@pytest.fixture
def driver(listener, wire):
    port = Parameter("port", value=wire.port)
    driver = ServoDriver(context=listener.context, parameter_overrides=[port])
    with spun(listener.context, [driver]):
        yield driver


@pytest.fixture
def both(listener, wire):
    """The mux and the driver, with somebody who listens."""
    port = Parameter("port", value=wire.port)
    mux = MotionMux(context=listener.context)
    driver = ServoDriver(context=listener.context, parameter_overrides=[port])
    with spun(listener.context, [mux, driver]):
        yield listener


def call(node, kind, name, request=None):
    client = node.create_client(kind, name)
    assert client.wait_for_service(10.0), name
    future = client.call_async(request or kind.Request())
    wait_until(future.done, 30.0, name)
    return future.result()


def change(node, transition):
    request = ChangeState.Request(transition=Transition(id=transition))
    return call(node, ChangeState, "/servo_driver/change_state", request).success


def state(node):
    return call(node, GetState, "/servo_driver/get_state").current_state.id


def turning(now, start=0.0, speed=0.4, seconds=2.0):
    """The head turns evenly."""
    times = now + np.linspace(0.0, seconds, 5)
    positions = (start + speed * (times - now))[:, None]
    return trajectory_to(JointTrajectory(("head_pan",), times, positions, np.full_like(positions, speed)))


def goals(wire):
    """Every goal that the head's servo got [rad]."""
    written = np.array([signed(goal, 4) for goal in wire.written(SERVO.id, "Goal Position")])
    return SERVO.direction * ((written - 2048) * 2 * np.pi / 4096 - SERVO.offset)


def let_pass(wire, cycles):
    """Wait for some bus cycles, however long they take; returns the goals of the head's servo in them."""
    before = len(goals(wire))
    wait_until(lambda: len(goals(wire)) >= before + cycles, 30, "the bus")
    return goals(wire)[before:]


def torque(wire):
    return {servo.get("Torque Enable") for servo in wire.servos.values()}


def test_inactive_holds_unconfigured_is_gone_and_both_come_back(driver, listener, wire):
    publisher = listener.create_publisher(JointTrajectoryMessage, "joint_trajectory", PLAN)
    wait_until(publisher.get_subscription_count, 10, "the driver")
    assert state(listener) == State.PRIMARY_STATE_ACTIVE, "without anybody's help"

    def moves():
        """Whether a trajectory moves the head, as its servo is sent."""
        place, begin = goals(wire)[-1], listener.now()
        publisher.publish(turning(begin, place, -0.4 if place > 0 else 0.4))
        wait_until(lambda: abs(goals(wire)[-1] - place) > 0.2 or listener.now() > begin + 3.0, 10, "its end")
        return abs(goals(wire)[-1] - place) > 0.2

    assert moves()
    assert change(listener, Transition.TRANSITION_DEACTIVATE)
    states = len(listener.record.joint_states)
    assert not moves()
    assert torque(wire) == {1}
    wait_until(lambda: len(listener.record.joint_states) > states + 20, 10, "joint states")
    assert change(listener, Transition.TRANSITION_ACTIVATE)
    assert moves()

    with pytest.raises(BusError, match="another program uses"):
        Bus(wire.port, ROBOT.bus.baudrate)
    assert change(listener, Transition.TRANSITION_DEACTIVATE)
    assert change(listener, Transition.TRANSITION_CLEANUP)
    assert goals(wire)[-1] == pytest.approx(ROBOT.rest[JOINT], abs=2e-3), "rest_then_off"
    assert torque(wire) == {0}
    Bus(wire.port, ROBOT.bus.baudrate).close()
    assert change(listener, Transition.TRANSITION_CONFIGURE)
    assert torque(wire) == {1}
    assert change(listener, Transition.TRANSITION_ACTIVATE)
    assert moves()


def test_a_transition_that_fails_or_does_not_fit_is_refused_and_the_node_lives_on(driver, listener, wire):
    assert not change(listener, Transition.TRANSITION_CONFIGURE), "it is active"
    assert state(listener) == State.PRIMARY_STATE_ACTIVE
    assert change(listener, Transition.TRANSITION_DEACTIVATE)
    assert change(listener, Transition.TRANSITION_CLEANUP)
    wire.faults.silent.add(SERVO.id)
    assert not change(listener, Transition.TRANSITION_CONFIGURE)
    assert state(listener) == State.PRIMARY_STATE_UNCONFIGURED
    wire.faults.silent.clear()
    assert change(listener, Transition.TRANSITION_CONFIGURE)


def test_a_stop_on_the_topic_brakes_within_five_bus_cycles_and_latches(both, wire):
    teleop = both.create_publisher(JointTrajectoryMessage, "teleop/joint_trajectory", PLAN)
    stop = both.create_publisher(Bool, "stop", PLAN)
    wait_until(lambda: teleop.get_subscription_count() and stop.get_subscription_count(), 10, "the mux")
    direct = both.create_publisher(JointTrajectoryMessage, "joint_trajectory", PLAN)
    cycles = []
    for speed in (0.4, -0.4, 0.4):  # the machine may be busy once
        begin = both.now()
        teleop.publish(turning(begin, goals(wire)[-1], speed, seconds=4.0))
        wait_until(lambda begin=begin: both.now() > begin + 1.5, 10, "the swing")
        before = len(goals(wire))
        stop.publish(Bool(data=True))
        let_pass(wire, 60)
        steps = np.abs(np.diff(goals(wire)[before - 11 :]))
        usual = np.median(steps[:10])
        assert usual > 2 * TICK, "it was in full swing"
        assert steps[-10:].max() == 0, "it stands"
        cycles.append(
            int(np.flatnonzero(steps[10:] < 0.6 * usual)[0]) + 1
        )  # no rounding to the servo's ticks

        # Whoever asks, whatever is asked: it stands until the reset.
        teleop.publish(turning(both.now()))
        direct.publish(turning(both.now()))
        assert np.ptp(let_pass(wire, 50)) == 0
        assert set(both.record.owners[-1].message.owners) == {"stop"}
        assert call(both, Trigger, "reset").success
    assert np.median(cycles) <= 5, cycles


def test_the_parameter_service_makes_and_ends_faults_of_the_virtual_bus(listener):
    driver = ServoDriver(context=listener.context)
    logged, kept = [], QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    listener.create_subscription(Log, "/rosout", lambda line: logged.append(line.msg), kept)

    def fault(words):
        parameter = Parameter("virtual_fault", value=words).to_parameter_msg()
        request = SetParameters.Request(parameters=[parameter])
        return call(listener, SetParameters, "/servo_driver/set_parameters", request).results[0]

    def told():
        heard = [one for diagnostics in listener.record.diagnostics for one in diagnostics.message.status]
        return next((one.message for one in reversed(heard) if one.name.endswith("servo bus")), "")

    with spun(listener.context, [driver]):
        assert fault(f"silent={SERVO.id}").successful
        wait_until(lambda: "head_pan does not answer" in told(), 10, "the fault")
        wait_until(lambda: logged.count("head_pan does not answer") == 1, 10, "a line of the log")
        refused = fault("rain=1")
        assert not refused.successful and "'rain'; valid: bit_noise" in refused.reason
        assert fault("").successful
        wait_until(lambda: "head_pan does not answer" not in told(), 10, "its end")
        wait_until(lambda: "all servos are in service again" in logged, 10, "that all is well")
    assert logged.count("head_pan does not answer") == 1


def test_a_second_program_that_moves_the_robot_is_told_until_it_ends(both):
    def told():
        heard = [one for diagnostics in both.record.diagnostics for one in diagnostics.message.status]
        return next((one.message for one in reversed(heard) if one.name.endswith("motion mux")), "")

    wait_until(lambda: told() == "open", 10, "that all is well")
    second = both.create_publisher(JointTrajectoryMessage, "joint_trajectory", PLAN)
    wait_until(lambda: "another program publishes joint_trajectory" in told(), 10, "the warning")
    both.destroy_publisher(second)
    wait_until(lambda: told() == "open", 30, "its end")


def test_joint_trajectory_controller_takes_what_the_mux_publishes(both):
    heard = []
    both.create_subscription(
        JointTrajectoryMessage, "joint_trajectory", lambda m: heard.append((both.now(), m)), PLAN
    )
    teleop = both.create_publisher(JointTrajectoryMessage, "teleop/joint_trajectory", PLAN)
    wait_until(teleop.get_subscription_count, 10, "the mux")
    teleop.publish(turning(both.now(), speed=1.5, seconds=1.0))
    wait_until(lambda: len(heard) > 50, 30, "trajectories")
    for now, message in heard:
        check_as_joint_trajectory_controller(message, now)
    moving = [m for _, m in heard if np.abs([p.velocities for p in m.points]).max() > 0.5]
    assert len(moving) > 2
    # Between the points it interpolates with cubics: none of them may ask for more than the joints can.
    for message in moving:
        times = np.array([seconds(point.time_from_start) for point in message.points])
        velocities = np.array([point.velocities for point in message.points])
        mean = np.diff(velocities[-2:], axis=0) / np.diff(times[-2:])
        assert (np.abs(mean) <= 1.001 * ROBOT.limits.acceleration).all()


def check_as_joint_trajectory_controller(message, now):
    """What validate_trajectory_msg of ros2_controllers checks, with its default parameters."""
    joints, points = message.joint_names, message.points
    assert sorted(joints) == sorted(ROBOT.joints), "allow_partial_joints_goal is false"
    assert points
    end = seconds(message.header.stamp) + seconds(points[-1].time_from_start)
    assert end >= now, "a trajectory that ends in the past is refused"
    assert (np.diff([0.0, *(seconds(point.time_from_start) for point in points[1:])]) > 0).all()
    for point in points:
        assert len(point.positions) == len(joints)
        assert len(point.velocities) in (0, len(joints))
        assert len(point.accelerations) in (0, len(joints))
        assert not point.effort
    # allow_nonzero_velocity_at_trajectory_end is false
    assert (np.abs(points[-1].velocities) <= np.finfo(np.float32).eps).all()
