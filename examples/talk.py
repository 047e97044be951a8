"""The robot says a text: python examples/talk.py Hello, I am glad to see you."""

import sys

import rclpy
from std_msgs.msg import String

rclpy.init()
node = rclpy.create_node("talk")
say = node.create_publisher(String, "say", 10)
while not say.get_subscription_count():  # `gesture-bot run` is not there yet: a message now would be lost
    rclpy.spin_once(node, timeout_sec=0.1)
say.publish(String(data=" ".join(sys.argv[1:]) or "Hello, I am glad to see you."))
say.wait_for_all_acked()
