"""Take a joint while the robot gestures, and give it back: python examples/teleop.py right_elbow."""

import math
import sys
import time

import rclpy
from builtin_interfaces.msg import Duration
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

joint = sys.argv[1] if len(sys.argv) > 1 else "right_elbow"
measured = {}

rclpy.init()
node = rclpy.create_node("teleop_example")
teleop = node.create_publisher(JointTrajectory, "teleop/joint_trajectory", 10)
node.create_subscription(
    JointState,
    "joint_states",
    lambda state: measured.update(zip(state.name, state.position, strict=True)),
    10,
)
while joint not in measured or not teleop.get_subscription_count():
    rclpy.spin_once(node, timeout_sec=0.1)
    if measured and joint not in measured:
        sys.exit(f"no such joint: {joint}; valid: {', '.join(measured)}")

# Whoever publishes owns the joints that it names; the others go on gesturing. The driver keeps limits, speeds
# and distances, whatever is asked for. After half a second of silence the joint is given back.
begin, middle = time.time(), measured[joint]
while time.time() < begin + 4.0:
    ahead = time.time() - begin + 0.3
    point = JointTrajectoryPoint(positions=[middle + 0.4 * math.sin(math.pi * ahead)])
    point.time_from_start = Duration(nanosec=300_000_000)  # where the joint should be in 0.3 s
    # Without a stamp, a trajectory begins when it comes.
    teleop.publish(JointTrajectory(joint_names=[joint], points=[point]))
    rclpy.spin_once(node, timeout_sec=0.0)
    time.sleep(0.1)
print(f"{joint} is given back at {measured[joint]:.2f} rad")
