"""The robot says a text: python examples/talk.py Hello, I am glad to see you."""

import sys
import time

import rclpy
from std_msgs.msg import String

rclpy.init()
node = rclpy.create_node("talk")
say = node.create_publisher(String, "say", 10)
node.get_logger().info("waiting for the robot: gesture-bot run")
listeners = []
# Until the robot listens, and not only somebody who records what is said, a message would be lost.
while "speech_source" not in listeners or say.get_subscription_count() < len(listeners):
    time.sleep(0.1)
    listeners = [one.node_name for one in node.get_subscriptions_info_by_topic("say")]
say.publish(String(data=" ".join(sys.argv[1:]) or "Hello, I am glad to see you."))
say.wait_for_all_acked()
