"""Keypoint clips in, joint trajectories out: each goes on from what was planned before, inside the limits."""

from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.fading import faded
from gesture_bot.base.frames import FRAME_RATE, KeypointClip
from gesture_bot.base.keypoints import KEYPOINTS
from gesture_bot.base.trajectory import JointTrajectory
from gesture_bot.retarget.directions import directions
from gesture_bot.retarget.follower import Follower
from gesture_bot.retarget.robot import Robot
from gesture_bot.retarget.solver import DirectionSolver

TICK_RATE = 50
"""Trajectory points a second. Tick n is at n / TICK_RATE [s since the epoch]."""

HALF_LIFE = 0.2
"""Half-life of the difference where a clip departs from what was planned before it [s]."""

HISTORY = 8
"""How far back before its last clip a retargeter can still go on from its own plan [s]."""

CONTEXT = 4
"""Frames before a clip that shape the interpolation at its start."""

SMOOTHING = 0.2
"""Share of each neighbour in a frame's angles. Angles that are solved one by one have corners where a joint
meets a limit or an arm the body; at 1 Hz this takes 3% of a motion, at 2 Hz 13%."""

COASTING = np.array([0.75, 0.5, 0.25])
"""Share of its last velocity with which a joint goes on in each frame after a clip. Clips of one frame, as an
operator sends them live, would otherwise be a stop each."""

STILL = 1e-6
"""A joint this close to its goal [rad] and this slow [rad/s] has arrived."""

HEADROOM = 0.8
"""Share of the velocity limits that plans use; the rest is for servos that have to catch up."""

FARTHEST = 100.0
"""No keypoint can be so far from the pelvis [m]."""


class Retargeter:
    """Plans a robot's joints from what keypoints do.

    Each frame becomes joint angles, starting from those of the frame before. They are smoothed a little, a
    cubic spline joins them, and a Follower keeps what it asks for inside the limits.

    Args:
        robot: For whom.
    """

    def __init__(self, robot: Robot):
        self._robot = robot
        self._limits = replace(robot.limits, velocity=HEADROOM * robot.limits.velocity)
        self._solver = DirectionSolver(robot)
        self._dt = 1 / TICK_RATE
        self.reset(robot.rest)

    def reset(self, position: np.ndarray) -> None:
        """Forget all plans. The next clip starts with the joints at rest at (j,) angles [rad].

        Raises:
            InvalidValueError: The position is not j finite numbers. The plans stand.
        """
        position = Follower(self._limits, self._dt, position).position
        # One entry a frame and a tick, from the first index on; the last one is held for ever.
        self._first_frame, self._angles = 0, position[None]
        self._first_tick, self._states = 0, np.stack([position, np.zeros_like(position)])[None]

    def push(self, clip: KeypointClip) -> JointTrajectory:
        """Plan the motion of a clip, in place of all that was planned from its first frame on.

        Returns:
            Points every 20 ms, from the first tick at or after the clip's first frame, where the joints are
            as they were planned before, to where they have come to rest, soon after its last.

        Raises:
            InvalidValueError: Keypoints are not (n, 17, 3), n > 0, or are NaN or too far. The plans stand.
        """
        keypoints = np.asarray(clip.keypoints, float)
        if keypoints.shape[1:] != (len(KEYPOINTS), 3) or not len(keypoints):
            raise InvalidValueError(
                "keypoints must be (n, 17, 3) with n > 0, but their shape is", keypoints.shape
            )
        usable = np.abs(keypoints) < FARTHEST
        if not usable.all():
            frame, keypoint = np.argwhere(~usable)[0, :2]
            raise InvalidValueError(
                f"frame {clip.start + frame} has a keypoint that is no number under {FARTHEST:g} m",
                KEYPOINTS[keypoint],
            )
        self._plan_frames(clip.start, directions(keypoints))
        self._plan_ticks(clip.start)
        first = _tick_after(clip.start)
        states = self._states[first - self._first_tick :]
        times = np.arange(first, first + len(states)) / TICK_RATE
        return JointTrajectory(self._robot.joints, times, states[:, 0].copy(), states[:, 1].copy())

    def _plan_frames(self, start: int, targets: np.ndarray) -> None:
        first = start - HISTORY * FRAME_RATE
        angles = list(_held(self._angles, np.arange(first, start) - self._first_frame))
        for target in targets:
            angles.append(self._solver.solve(target, angles[-1]))
        self._first_frame, self._angles = first, np.array([*angles, *self._coasting(angles)])

    def _coasting(self, angles: list[np.ndarray]) -> np.ndarray:
        """The frames in which the joints come to rest."""
        before, last = np.diff(angles[-3:], axis=0)
        # The smaller one, or none if they disagree: a jump is no velocity to go on with.
        velocity = np.median([before, last, np.zeros_like(last)], axis=0)
        frames = angles[-1] + np.cumsum(COASTING)[:, None] * velocity
        return np.clip(frames, self._robot.limits.lower, self._robot.limits.upper)

    def _plan_ticks(self, start: int) -> None:
        seam = _tick_after(start)
        first = seam - HISTORY * TICK_RATE
        states = list(_held(self._states, np.arange(first, seam + 1) - self._first_tick))
        follower = Follower(self._limits, self._dt, *states[-1])
        last = _tick_after(self._first_frame + len(self._angles) - 1)
        for target in self._targets(start, np.arange(seam, last + 1), states[-1]):
            states.append(np.array(follower.step(*target)))
        goal = np.stack([self._angles[-1], np.zeros(len(self._robot.joints))])
        while np.abs(states[-1] - goal).max() > STILL:
            states.append(np.array(follower.step(*goal)))
        states.append(np.array(follower.brake()))
        self._first_tick, self._states = first, np.array(states)

    def _targets(self, start: int, ticks: np.ndarray, state: np.ndarray) -> np.ndarray:
        """Positions and velocities to reach at each tick after the first: (n, 2, j).

        At the first the joints are in `state`: (2, j).
        """
        frames = _smoothed(self._angles[start - CONTEXT - self._first_frame :])
        spline = CubicSpline(np.arange(len(frames)), frames, bc_type=("natural", "clamped"))
        moments = (ticks * FRAME_RATE - (start - CONTEXT) * TICK_RATE) / TICK_RATE
        moments = np.minimum(moments, len(frames) - 1)
        targets = np.stack([spline(moments), spline(moments, 1) * FRAME_RATE], axis=1)
        elapsed = ((ticks - ticks[0]) * self._dt)[:, None]
        position, velocity = state - targets[0]
        departure = faded(position, velocity, elapsed, HALF_LIFE)
        return (targets + np.stack(departure, axis=1))[1:]


def _smoothed(frames: np.ndarray) -> np.ndarray:
    """(n, j) angles, each but the first and last drawn to those before and after it [rad]."""
    bends = np.pad(np.diff(frames, 2, axis=0), ((1, 1), (0, 0)))
    return frames + SMOOTHING * bends


def _held(values: np.ndarray, indices: np.ndarray) -> np.ndarray:
    """Entries at indices, the first and last held beyond the ends."""
    return values[np.clip(indices, 0, len(values) - 1)]


def _tick_after(frame: int) -> int:
    """The first tick at or after a frame."""
    return -(-frame * TICK_RATE // FRAME_RATE)
