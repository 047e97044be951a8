"""Stop the robot, until it is told to go on: python examples/stop.py, then python examples/stop.py reset."""

import sys

import rclpy
from std_srvs.srv import Trigger

service = "reset" if sys.argv[1:] == ["reset"] else "stop"

rclpy.init()
node = rclpy.create_node("stop_example")
client = node.create_client(Trigger, service)
if not client.wait_for_service(3.0):
    sys.exit(f"nobody answers on {service}: does `gesture-bot run` run, with the same ROS_DOMAIN_ID?")
answer = client.call_async(Trigger.Request())
rclpy.spin_until_future_complete(node, answer, timeout_sec=3.0)
# What counts is the answer: without one, take the power away.
print(answer.result().message if answer.done() else "NO ANSWER")
sys.exit(not answer.done())
