"""Did the robot do in time what was planned: from what a recorder heard."""

import numpy as np

from gesture_bot.base.frames import FRAME_RATE
from gesture_bot.evaluate.motion_report import stroke_time
from gesture_bot.nodes.messages import trajectory_from
from gesture_bot.nodes.recorder import Heard, Record
from gesture_bot.refine.smoothing import RADIUS
from gesture_bot.retarget.kinematics import Kinematics
from gesture_bot.retarget.retargeter import TICK_RATE
from gesture_bot.retarget.robot import Robot


def measured_stroke(
    record: Record, heard: Heard, times: np.ndarray, wrists: dict[str, np.ndarray], later: float = 0.0
) -> float | None:
    """When the robot's hands made the stroke of a keyword [s since the epoch]; None if they did not.

    Args:
        record: What passed.
        heard: The keyword.
        times: (n,) moments [s since the epoch].
        wrists: See robot_wrists.
        later: How much later than its word the stroke was due [s].
    """
    due = heard.stamp + later
    made = any(
        window.message.source == "bank"
        and window.message.name == heard.message.gesture
        and window.stamp < due + 1.0
        and window.arrival > heard.arrival
        for window in record.selected
    )
    strokes = [stroke_time(times, wrist, due) for wrist in wrists.values()] if made else []
    return min((s for s in strokes if s is not None), key=lambda s: abs(s - due), default=None)


def robot_wrists(robot: Robot, positions: np.ndarray) -> dict[str, np.ndarray]:
    """(n, 3) positions of each wrist over the robot's base [m]."""
    kinematics = Kinematics(robot)
    arms = {"left": robot.mapping.left_arm, "right": robot.mapping.right_arm}
    paths: dict[str, list[np.ndarray]] = {side: [] for side in arms}
    for angles in positions:
        kinematics.place(angles)
        for side, arm in arms.items():
            paths[side].append(kinematics.position(arm.wrist, arm.wrist_at))
    return {side: np.array(path) for side, path in paths.items()}


def deadline_misses(record: Record) -> int:
    """Windows that came too late, trajectories that began after their first new frame, late bus cycles."""
    windows = record.states[-1].message.late if record.states else 0
    # A trajectory begins with the frames before a window that are final only now; those may be seen already.
    known = RADIUS / FRAME_RATE
    trajectories = sum(heard.arrival > heard.stamp + known for heard in record.trajectories)
    statuses = [status for heard in record.diagnostics for status in heard.message.status]
    cycles = [int(v.value) for status in statuses for v in status.values if v.key == "late_cycles"]
    return windows + trajectories + (cycles[-1] if cycles else 0)


def planned_joints(record: Record) -> tuple[np.ndarray, np.ndarray]:
    """(n,) moments [s since the epoch] and (n, j) joint angles [rad] as the gesture was last planned."""
    plan: dict[int, np.ndarray] = {}
    for heard in record.trajectories:
        trajectory = trajectory_from(heard.message, heard.arrival)
        ticks = np.round(trajectory.times * TICK_RATE).astype(int)
        plan = {tick: angles for tick, angles in plan.items() if tick < ticks[0]}
        plan.update(zip(ticks.tolist(), trajectory.positions, strict=True))
    return np.array(list(plan)) / TICK_RATE, np.array(list(plan.values()))
