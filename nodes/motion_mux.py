"""Decides who moves each joint: gesture or operator; a stop outranks both and latches."""

from collections.abc import Callable
from typing import Any

from std_msgs.msg import Bool
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

from gesture_bot.msg import JointOwners
from gesture_bot.nodes.messages import trajectory_from, trajectory_to
from gesture_bot.nodes.node import PLAN, STATE, GestureNode, stamp
from gesture_bot.retarget.robot import load_robot
from gesture_bot.servo import mux

STOPPED = "stopped until `reset`"


class MotionMux(GestureNode):
    """Publishes, 25 times a second, the next 0.3 s of whoever owns each joint."""

    def __init__(self, name: str = "motion_mux", **options: Any):
        super().__init__(name, **options)
        robot = load_robot(self.parameter("robot", "toa", "Robot: a name in config/robots, or a YAML file"))
        self._mux = mux.MotionMux(robot.joints, robot.rest)
        self._owners: dict[str, str] = {}
        self._commands = self.create_publisher(JointTrajectory, "joint_trajectory", PLAN)
        self._owners_publisher = self.create_publisher(JointOwners, "motion_mux/owners", STATE)
        for source in (mux.GESTURE, mux.TELEOP):
            self._follow(source.name)
        self.listen_to_state(Bool, "teleop/lock", lambda message: self._mux.set_lock(message.data))
        self.listen_to_state(Bool, "stop", self._on_stop)
        self.create_service(Trigger, "stop", self._answer(self._mux.stop, STOPPED))
        self.create_service(
            Trigger, "reset", self._answer(self._mux.reset, "gestures and teleoperation go on")
        )
        self.every(0.04, self._tick)
        self.waits_for("trajectories on gesture/joint_trajectory and teleop/joint_trajectory")

    def _follow(self, source: str) -> None:
        def on_trajectory(message: JointTrajectory) -> None:
            now = self.now()
            self._mux.set_source(source, trajectory_from(message, now), now)

        self.listen(JointTrajectory, f"{source}/joint_trajectory", on_trajectory, PLAN)

    def _on_stop(self, message: Bool) -> None:
        if message.data:
            self._mux.stop()
            self._tick()
            self.get_logger().info(STOPPED)

    def _answer(self, act: Callable[[], None], outcome: str) -> Callable[..., Trigger.Response]:
        def answer(_request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            act()
            self._tick()
            self.get_logger().info(outcome)
            response.success, response.message = True, outcome
            return response

        return answer

    def _tick(self) -> None:
        self._commands.publish(trajectory_to(self._mux.tick(self.now())))
        owners = self._mux.owners
        if owners != self._owners:
            self._owners = owners
            message = JointOwners(joints=list(owners), owners=list(owners.values()))
            message.header.stamp = stamp(self.now())
            self._owners_publisher.publish(message)
