"""A graph in this process: nodes, and a robot that is where `joint_trajectory` wants it."""

import threading
from contextlib import contextmanager

import rclpy
from rclpy.executors import SingleThreadedExecutor
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from gesture_bot.nodes.messages import trajectory_from
from gesture_bot.nodes.node import PLAN, GestureNode, stamp
from gesture_bot.retarget.robot import load_robot


class MovingRobot(GestureNode):
    """Stands for servo_driver and the servos; it can be blocked by nothing."""

    def __init__(self, **options):
        super().__init__("moving_robot", **options)
        robot = load_robot("toa")
        self._joints, self._rest, self._plan = list(robot.joints), robot.rest.tolist(), None
        self._states = self.create_publisher(JointState, "joint_states", PLAN)
        self.listen(JointTrajectory, "joint_trajectory", self._on_trajectory, PLAN)
        self.every(0.02, self._publish)

    def _on_trajectory(self, message):
        self._plan = trajectory_from(message, self.now())

    def _publish(self):
        position = self._plan.at(self.now())[0].tolist() if self._plan else self._rest
        state = JointState(name=self._joints, position=position)
        state.header.stamp = stamp(self.now())
        self._states.publish(state)


@contextmanager
def spun(context, nodes):
    """Spins nodes in one thread, as `gesture-bot run` does, and destroys them in the end, last one first."""
    executor = SingleThreadedExecutor(context=context)
    for node in nodes:
        executor.add_node(node)
    ended = threading.Event()

    def spin():
        while not ended.is_set():
            executor.spin_once(timeout_sec=0.1)

    thread = threading.Thread(target=spin)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
        executor.shutdown()
        for node in reversed(nodes):
            node.destroy_node()


@contextmanager
def spinning(*classes):
    """A node of each class in a context of their own, spun; yields the nodes."""
    context = rclpy.Context()
    rclpy.init(context=context)
    nodes = [node_class(context=context) for node_class in classes]
    try:
        with spun(context, nodes):
            yield nodes
    finally:
        rclpy.shutdown(context=context)
