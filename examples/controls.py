"""Constraints on the motion while the robot speaks: the left hand high, then both hands calm, then free."""

import time

import rclpy
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

from gesture_bot.msg import Constraint, Control

# Each number of a message is a float: ROS takes 85 without a word, and sends 0.
LEFT_HIGH = Constraint(quantity=Constraint.WRIST_HEIGHT, hand=Constraint.LEFT, value=85.0)  # percentile
CALM = Constraint(  # of the database: the slowest third; or, with unit=Constraint.VALUE, metres a second
    quantity=Constraint.WRIST_SPEED, bound=Constraint.AT_MOST, value=33.0
)
NARROW = Constraint(quantity=Constraint.HAND_RADIUS, bound=Constraint.AT_MOST, value=50.0)

rclpy.init()
node = rclpy.create_node("controls")
latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
control = node.create_publisher(Control, "control", latched)
say = node.create_publisher(String, "say", 10)
node.get_logger().info("waiting for the robot: gesture-bot run")
listeners = []
while "speech_source" not in listeners or say.get_subscription_count() < len(listeners):
    time.sleep(0.1)
    listeners = [one.node_name for one in node.get_subscriptions_info_by_topic("say")]
say.publish(
    String(data="Now my left hand is up. Now both my hands are calm, and near. And now they are free.")
)
for constraints in [LEFT_HIGH], [CALM, NARROW], []:  # each message replaces the one before
    control.publish(Control(constraints=constraints))
    print([constraint.quantity for constraint in constraints] or "free")
    time.sleep(3.0)  # it shows in the next window that is planned, about a second later
