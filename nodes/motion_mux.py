"""Decides who moves each joint, by priority; a stop outranks all and latches."""

import math
import threading
from collections.abc import Callable
from typing import Any

from std_msgs.msg import Bool
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

from gesture_bot.msg import JointOwners
from gesture_bot.nodes.discovery import movers
from gesture_bot.nodes.messages import trajectory_from, trajectory_to
from gesture_bot.nodes.node import PLAN, STATE, GestureNode, diagnostic, stamp
from gesture_bot.nodes.urgent import UrgentNode
from gesture_bot.retarget.robot import load_robot
from gesture_bot.servo import mux
from gesture_bot.servo.arbitration import Lock, Source, load_arbitration

STOPPED = "stopped until `reset`"
COMPANY = "another program publishes joint_trajectory, and moves the robot, too: does a second graph run?"


class MotionMux(GestureNode):
    """Publishes, 25 times a second, the next 0.3 s of whoever owns each joint."""

    def __init__(self, name: str = "motion_mux", **options: Any):
        super().__init__(name, **options)
        robot = load_robot(self.parameter("robot", "toa", "Robot: a name in config/robots, or a YAML file"))
        sources, locks = load_arbitration(
            self.parameter("sources", "shipped", "Sources of motion and locks: a YAML file, or 'shipped'")
        )
        self._mux = mux.MotionMux(robot.limits, robot.rest, sources, locks)
        self._turn = threading.RLock()
        self._owners: dict[str, str] = {}
        self._commands = self.create_publisher(JointTrajectory, "joint_trajectory", PLAN)
        self._owners_publisher = self.create_publisher(JointOwners, "motion_mux/owners", STATE)
        for source in sources:
            self._follow(source)
        for lock in locks:
            self._obey(lock)
        self._urgent = UrgentNode(self)
        self._urgent.listen_to_state(Bool, self.resolve_topic_name("stop"), self._on_stop)
        for name, act, outcome in (
            ("stop", self._mux.stop, STOPPED),
            ("reset", self._mux.reset, "gestures and teleoperation go on"),
        ):
            self._urgent.create_service(Trigger, self.resolve_service_name(name), self._answer(act, outcome))
        self.every(0.04, self._tick)
        self.every(1.0, self._report)
        self.waits_for(f"trajectories on {' and '.join(source.topic for source in sources)}")

    def destroy_node(self) -> None:
        """Hear no stop any more, either."""
        self._urgent.destroy_node()
        super().destroy_node()

    def _follow(self, source: Source) -> None:
        def on_trajectory(message: JointTrajectory) -> None:
            now = self.now()
            trajectory = trajectory_from(message, now)
            with self._turn:
                self._mux.set_source(source.name, trajectory, now)

        self.listen(JointTrajectory, source.topic, on_trajectory, PLAN)

    def _obey(self, lock: Lock) -> None:
        def on_lock(message: Bool) -> None:
            with self._turn:
                self._mux.set_lock(lock.name, message.data, self.now())

        if lock.timeout < math.inf:
            self.listen(Bool, lock.topic, on_lock, PLAN)  # each one is a sign of life
        else:
            self.listen_to_state(Bool, lock.topic, on_lock)

    def _on_stop(self, message: Bool) -> None:
        if message.data:
            self._act(self._mux.stop, STOPPED)

    def _answer(self, act: Callable[[], None], outcome: str) -> Callable[..., Trigger.Response]:
        def answer(_request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            self._act(act, outcome)
            response.success, response.message = True, outcome
            return response

        return answer

    def _act(self, act: Callable[[], None], outcome: str) -> None:
        with self._turn:
            act()
            self._tick()
        self.get_logger().info(outcome)

    def _report(self) -> None:
        troubles = [COMPANY] if movers(self) > 1 else []
        if troubles:
            self.get_logger().warning(COMPANY, throttle_duration_sec=10.0)
        troubles += [STOPPED] if self._mux.stopped else []
        troubles += [f"locked by {lock.name} ({lock.topic})" for lock in self._mux.locks(self.now())]
        owners: dict[str, Any] = dict(self._mux.owners)
        self.diagnose(diagnostic("motion mux", troubles + self.errors(), "open", **owners))

    def _tick(self) -> None:
        with self._turn:
            self._commands.publish(trajectory_to(self._mux.tick(self.now())))
            owners = self._mux.owners
            if owners != self._owners:
                self._owners = owners
                message = JointOwners(joints=list(owners), owners=list(owners.values()))
                message.header.stamp = stamp(self.now())
                self._owners_publisher.publish(message)
