"""What RViz and Foxglove show: the robot's description, where its links are, and the keypoints."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from geometry_msgs.msg import Point, Pose, Quaternion, TransformStamped, Vector3
from rclpy.publisher import Publisher
from rclpy.timer import Timer
from sensor_msgs.msg import JointState
from std_msgs.msg import ColorRGBA, Header, String
from visualization_msgs.msg import Marker, MarkerArray

from gesture_bot.base.frames import FRAME_RATE, frame_time
from gesture_bot.base.keypoints import BONES
from gesture_bot.msg import GestureWindow
from gesture_bot.nodes.messages import clip_from, duration
from gesture_bot.nodes.node import PLAN, STATE, STREAM, GestureNode, diagnostic, seconds, stamp
from gesture_bot.retarget.link_frames import LinkFrame, LinkFrames
from gesture_bot.retarget.robot import load_robot

try:
    from tf2_msgs.msg import TFMessage
except ImportError:  # it comes with ROS 2, and is not on PyPI
    TFMessage = None

BESIDE = Point(x=0.0, y=-1.0, z=0.0)
"""Where the person stands from the robot's base [m]: placed without tf, which not everybody has."""

COLORS = {
    "gesture/selected": ColorRGBA(r=0.98, g=0.6, b=0.1, a=0.7),
    "gesture/refined": ColorRGBA(r=0.16, g=0.55, b=0.6, a=1.0),
}

TF_RATE = 30.0
"""Transforms a second [Hz]."""

THICKNESS = 0.02
"""Of the stick figures [m]."""


class Visualizer(GestureNode):
    """Works while somebody looks: markers and transforms are made only while they have a subscriber."""

    def __init__(self, name: str = "visualizer", **options: Any):
        super().__init__(name, **options)
        robot = load_robot(self.parameter("robot", "toa", "Robot: a name in config/robots, or a YAML file"))
        self._robot, self._frames = robot, LinkFrames(robot)
        # The frames of two robots may meet in one tf tree.
        self._prefix = "" if self.get_namespace() == "/" else f"{self.get_namespace().strip('/')}/"
        self._windows: dict[str, dict[int, np.ndarray]] = {topic: {} for topic in COLORS}
        self._placed = 0.0
        self._description = self.create_publisher(String, "robot_description", STATE)
        self._description.publish(String(data=robot.urdf))
        self._markers = self.create_publisher(MarkerArray, "gesture/markers", PLAN)
        self._views = [_View("keypoints", self._markers, self._watch_keypoints)]
        if TFMessage:
            self._tf = self.create_publisher(TFMessage, "/tf", PLAN)
            self._views.append(_View("tf", self._tf, self._watch_joints))
            self._fixed = self.create_publisher(TFMessage, "/tf_static", STATE)
            self._fixed.publish(TFMessage(transforms=self.fixed_transforms()))
        self.every(1.0, self._look_around)
        self.waits_for("somebody who looks")

    def fixed_transforms(self) -> list[TransformStamped]:
        """Links that never move."""
        return [self._transform(frame, self.now()) for frame in self._frames.fixed()]

    def moving_transforms(self, state: JointState) -> list[TransformStamped]:
        """Links with joints, where the measured joints have them; a joint without measure is at rest."""
        angles = dict(zip(self._robot.joints, self._robot.rest, strict=True))
        angles |= {
            name: angle for name, angle in zip(state.name, state.position, strict=True) if name in angles
        }
        frames = self._frames.moving(np.array(list(angles.values())))
        return [self._transform(frame, seconds(state.header.stamp)) for frame in frames]

    def _look_around(self) -> None:
        for view in self._views:
            watched = view.publisher.get_subscription_count() > 0
            if watched and not view.sources:
                view.sources = view.watch()
            elif not watched:
                for source in view.sources:
                    (self.destroy_timer if isinstance(source, Timer) else self.destroy_subscription)(source)
                view.sources = []
        shown = [view.name for view in self._views if view.sources]
        self.diagnose(diagnostic("visualizer", self.errors(), f"shows {' and '.join(shown) or 'nothing'}"))

    def _watch_keypoints(self) -> list[Any]:
        def keep(topic: str) -> Callable[[GestureWindow], None]:
            def on_window(message: GestureWindow) -> None:
                clip, frames = clip_from(message), self._windows[topic]
                for frame in [frame for frame in frames if frame >= clip.start]:
                    del frames[frame]
                frames.update(enumerate(clip.keypoints, clip.start))

            return on_window

        heard = [self.listen(GestureWindow, topic, keep(topic), PLAN) for topic in COLORS]
        return [*heard, self.every(1 / FRAME_RATE, self._draw)]

    def _watch_joints(self) -> list[Any]:
        def on_state(state: JointState) -> None:
            if self.now() > self._placed + 1 / TF_RATE:
                self._placed = self.now()
                self._tf.publish(TFMessage(transforms=self.moving_transforms(state)))

        return [self.listen(JointState, "joint_states", on_state, STREAM)]

    def _draw(self) -> None:
        """The frame that is seen now."""
        current, markers = int(self.now() * FRAME_RATE), []
        for number, (topic, frames) in enumerate(self._windows.items()):
            for passed in [frame for frame in frames if frame < current]:
                del frames[passed]
            if current in frames:
                markers += self._figure(number, topic, frame_time(current), frames[current])
        if markers:
            self._markers.publish(MarkerArray(markers=markers))

    def _figure(self, number: int, topic: str, moment: float, keypoints: np.ndarray) -> list[Marker]:
        points = [Point(x=x, y=y, z=z) for x, y, z in keypoints.tolist()]
        bones = [points[end] for bone in BONES for end in bone]
        return [
            Marker(
                header=Header(stamp=stamp(moment), frame_id=self._prefix + self._frames.base),
                ns=topic,
                id=2 * number + kind,
                type=(Marker.LINE_LIST, Marker.SPHERE_LIST)[kind],
                pose=Pose(position=BESIDE, orientation=Quaternion(w=1.0)),
                scale=Vector3(x=size, y=size, z=size),
                color=COLORS[topic],
                lifetime=duration(0.5),
                points=(bones, points)[kind],
            )
            for kind, size in enumerate((THICKNESS, 2 * THICKNESS))
        ]

    def _transform(self, frame: LinkFrame, moment: float) -> TransformStamped:
        x, y, z, w = frame.rotation.tolist()
        transform = TransformStamped(child_frame_id=self._prefix + frame.link)
        transform.header = Header(stamp=stamp(moment), frame_id=self._prefix + frame.parent)
        transform.transform.translation = Vector3(**dict(zip("xyz", frame.position.tolist(), strict=True)))
        transform.transform.rotation = Quaternion(x=x, y=y, z=z, w=w)
        return transform


@dataclass
class _View:
    """A kind of message, and what it is made of while somebody looks: subscriptions and timers."""

    name: str
    publisher: Publisher
    watch: Callable[[], list[Any]]
    sources: list[Any] = field(default_factory=list)
