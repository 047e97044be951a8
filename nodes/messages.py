"""Between messages and the plain values that the rooms work on."""

import numpy as np
from builtin_interfaces.msg import Duration
from trajectory_msgs.msg import JointTrajectory as JointTrajectoryMessage
from trajectory_msgs.msg import JointTrajectoryPoint

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.frames import FRAME_RATE, KeypointClip, frame_time
from gesture_bot.base.keypoints import KEYPOINTS
from gesture_bot.base.trajectory import JointTrajectory
from gesture_bot.msg import GestureWindow
from gesture_bot.nodes.node import seconds, stamp


def clip_from(message: GestureWindow) -> KeypointClip:
    """The keypoints of a window, on the frame next to its stamp.

    Raises:
        InvalidValueError: The number of values is not a multiple of 17 x 3, or there are none.
    """
    values = np.asarray(message.keypoints, np.float32)
    frame_size = 3 * len(KEYPOINTS)
    if not len(values) or len(values) % frame_size:
        raise InvalidValueError(
            f"the number of keypoint values is no multiple of {len(KEYPOINTS)} x 3", len(values)
        )
    start = round(seconds(message.header.stamp) * FRAME_RATE)
    return KeypointClip(start, values.reshape(-1, len(KEYPOINTS), 3))


def clip_to(clip: KeypointClip, source: str) -> GestureWindow:
    """The message of keypoint frames."""
    message = GestureWindow(source=source, sequence=-1, frame=-1)
    message.header.stamp = stamp(frame_time(clip.start))
    message.header.frame_id = "pelvis"
    message.keypoints.frombytes(np.ascontiguousarray(clip.keypoints, np.float32).tobytes())
    return message


def trajectory_from(message: JointTrajectoryMessage, now: float) -> JointTrajectory:
    """A joint trajectory; a zero stamp means now, as joint_trajectory_controller reads it.

    Raises:
        InvalidValueError: No points, or a point whose positions or velocities do not match the joints.
    """
    joints = tuple(message.joint_names)
    for point in message.points:
        if len(point.positions) != len(joints) or len(point.velocities) not in (0, len(joints)):
            raise InvalidValueError(
                f"a trajectory point has {len(point.positions)} positions and {len(point.velocities)} "
                f"velocities for {len(joints)} joints"
            )
    if not message.points or not joints:
        raise InvalidValueError("a joint trajectory has no points or no joints")
    begin = seconds(message.header.stamp) or now
    return JointTrajectory(
        joints,
        np.array([begin + seconds(point.time_from_start) for point in message.points]),
        np.array([point.positions for point in message.points], float).reshape(-1, len(joints)),
        np.array([point.velocities or [0.0] * len(joints) for point in message.points], float),
    )


def trajectory_to(trajectory: JointTrajectory) -> JointTrajectoryMessage:
    """The message of a joint trajectory, its points counted from the first."""
    message = JointTrajectoryMessage(joint_names=list(trajectory.joints))
    message.header.stamp = stamp(trajectory.times[0])
    message.points = [
        JointTrajectoryPoint(
            positions=positions.tolist(), velocities=velocities.tolist(), time_from_start=duration(after)
        )
        for after, positions, velocities in zip(
            trajectory.times - trajectory.times[0], trajectory.positions, trajectory.velocities, strict=True
        )
    ]
    return message


def duration(length: float) -> Duration:
    """Seconds as a builtin_interfaces/Duration."""
    nanoseconds = round(length * 1e9)
    return Duration(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
