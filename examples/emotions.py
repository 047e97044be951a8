"""The robot feels something else at each sentence, and this program knows when each one has been heard."""

import rclpy
from rclpy.action import ActionClient
from rclpy.qos import DurabilityPolicy, QoSProfile

from gesture_bot.action import Speak
from gesture_bot.msg import Emotion

STORY = (
    (Emotion.HAPPY, "What a fine day!"),
    (Emotion.SAD, "But my old friend is gone."),
    (Emotion.ANGRY, "Nobody has told me!"),
)

rclpy.init()
node = rclpy.create_node("emotions")
# Latched, like all that says how things are: whoever comes later hears the last one.
latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
emotion = node.create_publisher(Emotion, "emotion", latched)
# The action `speak` is the topic `say` with answers.
speak = ActionClient(node, Speak, "speak")
node.get_logger().info("waiting for the robot: gesture-bot run")
speak.wait_for_server()


def wait(future):
    """Let the node work until there is an answer."""
    rclpy.spin_until_future_complete(node, future)
    return future.result()


for expression, text in STORY:
    # The voice takes it from the next text on, the gestures from the next window on.
    emotion.publish(Emotion(expression=expression))
    goal = wait(speak.send_goal_async(Speak.Goal(text=text)))
    heard = wait(goal.get_result_async()).result
    print(f"{expression}: {text}", "heard" if heard.spoken else heard.message)
emotion.publish(Emotion(expression=Emotion.NEUTRAL))
emotion.wait_for_all_acked()
