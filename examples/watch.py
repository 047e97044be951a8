"""Watch the robot: where its joints are, who moves them, and what is wrong. Ctrl-C ends it."""

from contextlib import suppress

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.executors import ExternalShutdownException
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import JointState

from gesture_bot.msg import JointOwners

positions, owners, troubles = {}, {}, {}


def on_states(message: JointState) -> None:
    """100 times a second, measured by the servos [rad]."""
    positions.update(zip(message.name, message.position, strict=True))


def on_owners(message: JointOwners) -> None:
    """Only when it changes."""
    owners.update(zip(message.joints, message.owners, strict=True))


def on_diagnostics(message: DiagnosticArray) -> None:
    """Once a second from every node, an entry a part: a servo, a sound card, a source of sound."""
    for part in message.status:
        troubles[part.name] = "" if part.level == DiagnosticStatus.OK else part.message


def show() -> None:
    """A line a joint, and what is not as it should be."""
    for joint, angle in positions.items():
        print(f"{joint:22} {angle:6.2f} rad  moved by {owners.get(joint, 'nobody')}")
    print(*(f"{part}: {trouble}" for part, trouble in troubles.items() if trouble), sep="\n", flush=True)


rclpy.init()
node = rclpy.create_node("watch")
node.create_subscription(JointState, "joint_states", on_states, qos_profile_sensor_data)
latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)  # hears the last one at once
node.create_subscription(JointOwners, "motion_mux/owners", on_owners, latched)
node.create_subscription(DiagnosticArray, "/diagnostics", on_diagnostics, 100)
node.create_timer(1.0, show)
with suppress(KeyboardInterrupt, ExternalShutdownException):
    rclpy.spin(node)
