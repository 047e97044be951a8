"""A gamepad's messages in, the robot's motion out, through the mux: on the topics alone."""

import threading
import time

import numpy as np
import pytest
from conftest import wait_until
from moving_robot import MovingRobot, spinning
from sensor_msgs.msg import Joy
from std_msgs.msg import Bool
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

from gesture_bot.nodes.joy_teleop import JoyTeleop
from gesture_bot.nodes.motion_mux import MotionMux
from gesture_bot.nodes.node import PLAN
from gesture_bot.retarget.robot import load_robot

pytestmark = pytest.mark.live

ROBOT = load_robot("toa")
LEFT = tuple(joint for joint in ROBOT.joints if joint.startswith("left_"))
SHOULDER, ELBOW = ROBOT.joints.index("left_shoulder_pitch"), ROBOT.joints.index("left_elbow")
B, LEFT_BUTTON = 1, 9
UP, RIGHT_STICK_UP = 1, 3
REST = Joy(axes=[0.0] * 6, buttons=[0] * 21)


def joy(*pressed, **axes):
    """As game_controller_node sends it: these buttons pressed, these axes deflected."""
    message = Joy(axes=[0.0] * 6, buttons=[int(button in pressed) for button in range(21)])
    for axis, value in axes.items():
        message.axes[int(axis.removeprefix("axis"))] = value
    return message


class Pad:
    """Sends its present message twenty times a second, as joy does; None is silence."""

    def __init__(self, node):
        self.message = REST
        self._publisher = node.create_publisher(Joy, "joy", 10)
        wait_until(self._publisher.get_subscription_count, 10, "joy_teleop")

    def send(self, ended):
        while not ended.wait(0.05):
            if self.message:
                self._publisher.publish(self.message)


@pytest.fixture
def pad(listener):
    """A pad in somebody's hand, beside a mux and a robot; `listener` hears all."""
    listener.asked = []
    listener.create_subscription(JointTrajectory, "teleop/joint_trajectory", listener.asked.append, PLAN)
    ended = threading.Event()
    with spinning(MovingRobot, MotionMux, JoyTeleop):
        wait_until(lambda: listener.record.joint_states and listener.record.owners, 10, "the graph")
        pad = Pad(listener)
        sending = threading.Thread(target=pad.send, args=(ended,), daemon=True)
        sending.start()
        time.sleep(0.5)
        yield pad
        ended.set()
        sending.join()


def owners(node):
    message = node.record.owners[-1].message
    return dict(zip(message.joints, message.owners, strict=True))


def owned(node):
    return tuple(joint for joint, owner in owners(node).items() if owner == "teleop")


def position(node):
    return np.array(node.record.joint_states[-1].message.position)


def status(node):
    """What joy_teleop says on /diagnostics."""
    statuses = [one for heard in node.record.diagnostics for one in heard.message.status]
    return ["", *(one.message for one in statuses if one.name == "gesture_bot: joy teleop")][-1]


def test_an_arm_moves_while_its_button_is_held_and_is_given_back(listener, pad):
    pad.message = joy(axis1=1.0, axis3=-0.05)
    time.sleep(0.5)
    assert not listener.asked, "no button is held"
    pad.message = joy(LEFT_BUTTON, axis1=1.0, axis3=-0.05)
    wait_until(lambda: position(listener)[SHOULDER] > ROBOT.rest[SHOULDER] + 0.3, 5, "the shoulder to move")
    assert owned(listener) == LEFT
    wait_until(lambda: "moves left_shoulder_pitch, " in status(listener), 3, "the diagnostic")
    others = np.delete(position(listener) - ROBOT.rest, SHOULDER)
    np.testing.assert_allclose(others, 0, atol=1e-6, err_msg="an axis in its dead zone, and the other arm")
    first = listener.asked[0]
    assert tuple(first.joint_names) == LEFT
    np.testing.assert_allclose(first.points[0].positions, ROBOT.rest[:5], atol=0.02)
    fastest = max(abs(point.velocities[0]) for message in listener.asked for point in message.points)
    assert fastest == pytest.approx(0.25 * ROBOT.limits.velocity[SHOULDER], rel=1e-6)

    pad.message = joy(axis1=1.0)
    wait_until(lambda: not owned(listener), 2, "the arm to be given back")
    sent = len(listener.asked)
    time.sleep(0.3)
    assert len(listener.asked) == sent


def test_a_silent_pad_is_let_go(listener, pad):
    pad.message = joy(LEFT_BUTTON, axis3=1.0)
    wait_until(lambda: position(listener)[ELBOW] > ROBOT.rest[ELBOW] + 0.3, 5, "the elbow to move")
    pad.message, before = None, position(listener)[ELBOW]
    wait_until(lambda: not owned(listener), 3, "the arm to be given back")
    # It went on for 0.2 s, and braked; the way through the graph takes 0.1 s more.
    assert position(listener)[ELBOW] - before < 0.6 * 0.25 * ROBOT.limits.velocity[ELBOW]


def test_stop_latches_and_a_held_button_must_be_let_go_first(listener, pad):
    pad.message = joy(LEFT_BUTTON, axis3=1.0)
    wait_until(lambda: position(listener)[ELBOW] > ROBOT.rest[ELBOW] + 0.2, 5, "the elbow to move")
    pad.message = joy(LEFT_BUTTON, B, axis3=1.0)
    wait_until(lambda: set(owners(listener).values()) == {"stop"}, 2, "the stop")
    pad.message = joy(LEFT_BUTTON, axis3=1.0)
    reset = listener.create_client(Trigger, "reset")
    assert reset.wait_for_service(5)
    time.sleep(0.5)
    assert set(owners(listener).values()) == {"stop"}
    reset.call_async(Trigger.Request())
    wait_until(lambda: "stop" not in owners(listener).values(), 2, "the reset")
    time.sleep(0.3)
    assert not owned(listener), "nobody has pressed anything since"
    pad.message = REST
    time.sleep(0.2)
    pad.message = joy(LEFT_BUTTON, axis3=-1.0)
    wait_until(lambda: owned(listener) == LEFT, 2, "the arm to be taken again")

    stop = listener.create_publisher(Bool, "stop", PLAN)
    wait_until(lambda: stop.get_subscription_count() == 1, 5, "the mux")
    stop.publish(Bool(data=True))
    wait_until(lambda: set(owners(listener).values()) == {"stop"}, 2, "somebody else's stop")
    sent = len(listener.asked)
    time.sleep(0.3)
    assert len(listener.asked) <= sent + 1


def test_a_pad_that_lacks_a_button_is_named_once_moves_nothing_and_still_stops(listener, pad, capfd):
    pad.message = Joy(axes=[0.0, 1.0, 0.0, 1.0], buttons=[0] * 9 + [1])
    time.sleep(0.8)
    said = [line for line in capfd.readouterr().err.splitlines() if "joy: " in line]
    assert len(said) == 1 and "the gamepad lacks an assigned button: 13; valid: 0 to 9" in said[0]
    assert not listener.asked
    wait_until(lambda: "button: 13" in status(listener), 3, "the diagnostic")
    pad.message = Joy(axes=[0.0, float("nan"), 0.0, 0.0], buttons=[0] * 21)
    time.sleep(0.3)
    assert "axis 1 of the gamepad is not a finite number: nan" in capfd.readouterr().err
    pad.message = Joy(buttons=[0, 1])
    wait_until(lambda: set(owners(listener).values()) == {"stop"}, 2, "the stop")
