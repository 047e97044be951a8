"""Directions to joint angles: the retargeting objective and its solver."""

import numpy as np

from gesture_bot.base.errors import RobotError
from gesture_bot.retarget.clearance import Clearance
from gesture_bot.retarget.kinematics import Kinematics
from gesture_bot.retarget.robot import Robot

WEIGHTS = np.array([1.0, 1.0, 0.3, 1.0, 1.0, 0.3, 1.0])
"""Of the squared errors of DIRECTIONS but the hands. A palm is to turn the wrist, hardly to bend the arm."""

CONTACT = 0.5
"""Weight of the way between the wrists, where a person's are on one point. Hands that touch are to touch: by
directions alone they do so only on a robot with the person's proportions."""

TOUCHING = 0.4
"""With wrists this far apart it is a factor e less, twice as far e^4 [arm lengths]."""

HEIGHT = 0.2
"""Weight of the difference of the wrists' heights, always: which hand is higher is to stay so."""

TO_PREVIOUS = 0.02
"""Weight of the squared distance to the angles before [1/rad^2]. It prevents jumps where an angle hardly
matters: a straight elbow leaves the upper arm's yaw free."""

TO_REST = 0.002
"""Weight of the squared distance to the rest pose [1/rad^2]: what is free drifts home."""

KEPT = 0.06
"""Forearms and hands are to keep this far from the rest of the robot, as a share of the arm's length."""

CROWDED = 0.3
"""Coming closer by this share of it weighs as much as a direction that is off by a length of one."""

BACKWARD_STEPS = 8
"""Where a pose would still touch the robot itself, the way back to the last one is searched in such steps."""

_ORDER = np.array([0, 1, 4, 2, 3, 5, 6, 7])
"""From bones (left upper arm, left forearm, right ...), axes (palms, face) and the hands to DIRECTIONS."""

_FOREARMS = [1, 4]
"""Of DIRECTIONS."""

_NEXT, _LAST = [1, 2, 0], [2, 0, 1]
"""Indices of a cross product, which numpy.cross is slow at."""

ITERATIONS = 4
LARGEST_STEP = 0.5
SMALLEST_STEP = 0.01
"""Most Gauss-Newton steps a pose, and the largest change of an angle in one [rad]; one in which no angle
changes by the smallest is the last."""


class DirectionSolver:
    """Joint angles whose links point as a person's do.

    Minimises, inside the position limits, the weighted squared differences of directions and of the way
    between the wrists, and the weighted squared distances to the angles before and to the rest pose, and
    keeps the arms off the robot itself.
    Joints between base and torso stay where they are.

    Args:
        robot: For whom.

    Raises:
        RobotError: Two links that the mapping draws a line between lie on one point.
    """

    # Own Gauss-Newton on MuJoCo's Jacobians. mink 1.3 with DAQP, given the same objective, is as accurate
    # and takes more than twice as long, and its direction task knows axes of one link alone, not lines from
    # link to link.

    def __init__(self, robot: Robot):
        self._limits, self._rest = robot.limits, robot.rest
        self._kinematics = Kinematics(robot)
        left, right, head = robot.mapping.left_arm, robot.mapping.right_arm, robot.mapping.head
        self._parents = self._links(left.shoulder, left.elbow, right.shoulder, right.elbow)
        self._children = self._links(left.elbow, left.wrist, right.elbow, right.wrist)
        self._ends = np.array([np.zeros(3), left.wrist_at, np.zeros(3), right.wrist_at])
        self._turned = self._links(left.hand, right.hand, head.link)
        self._measured = np.concatenate([self._children, self._parents, self._turned])
        self._axes = np.array([left.palm, right.palm, head.forward])
        # An arm without a wrist has nothing to turn its palm with but the arm itself.
        weights = WEIGHTS.copy()
        weights[[2, 5]] *= [left.hand != left.elbow, right.hand != right.elbow]
        self._weights = np.repeat(weights, 3)
        self._torso = self._links(robot.mapping.torso)
        self._torso_axes = robot.mapping.torso_axes()
        self._check_bones()
        self._below_torso = ~self._kinematics.joints_above(self._torso[0])
        self._clearance = Clearance(robot, self._kinematics)
        self._arm = float(self._lengths().sum()) / 2
        self._kept, self._crowded = KEPT * self._arm, CROWDED * self._arm

    def solve(self, targets: np.ndarray, previous: np.ndarray) -> np.ndarray:
        """The angles for one frame.

        Args:
            targets: (8, 3) directions in the torso's frame, rows as in DIRECTIONS.
            previous: (j,) angles of the frame before [rad].

        Returns:
            (j,) angles inside the limits [rad].
        """
        angles, lower, upper = previous, self._limits.lower, self._limits.upper
        weights = np.append(self._weights, _weights_of_hands(targets))
        for _ in range(ITERATIONS):
            current, jacobian = self.linearise(angles)
            weighted = jacobian.T * weights
            hessian = weighted @ jacobian
            hessian.flat[:: len(angles) + 1] += TO_PREVIOUS + TO_REST
            gradient = (
                weighted @ (current - targets).ravel()
                + TO_PREVIOUS * (angles - previous)
                + TO_REST * (angles - self._rest)
            )
            distances, parting = self._clearance.rows(self._kept)
            if len(distances):
                parting *= self._below_torso / self._crowded
                hessian += parting.T @ parting
                gradient -= (self._kept - distances) / self._crowded @ parting
            lowest = np.minimum(np.maximum(lower - angles, -LARGEST_STEP), LARGEST_STEP)
            highest = np.minimum(np.maximum(upper - angles, -LARGEST_STEP), LARGEST_STEP)
            step = _bounded_step(hessian, gradient, lowest, highest)
            angles = angles + step
            if np.abs(step).max() < SMALLEST_STEP:
                break
        return self._clear(previous, np.clip(angles, lower, upper))

    def reached(self, angles: np.ndarray) -> np.ndarray:
        """The robot's own (8, 3) directions at (j,) angles [rad], in its torso's frame."""
        return self.linearise(angles)[0]

    def linearise(self, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The robot's (8, 3) directions in its torso's frame, and their (24, j) derivatives.

        Args:
            angles: (j,) [rad].
        """
        data = self._kinematics.data
        self._kinematics.place(angles)
        starts, ends = data.xpos[self._parents], self._end_points()
        lines = ends - starts
        lengths = np.sqrt((lines * lines).sum(axis=1, keepdims=True))
        bones = lines / lengths
        jacobians = self._kinematics.jacobians(
            self._measured, np.concatenate([ends, starts, data.xpos[self._turned]])
        )
        moving = (jacobians[:4, 0] - jacobians[4:8, 0]) / lengths[:, None]
        hands = (ends[1] - ends[3]) / self._arm
        parting = (jacobians[1, 0] - jacobians[3, 0]) / self._arm
        moving -= bones[:, :, None] * (bones[:, None] @ moving)
        axes = data.xmat[self._turned].reshape(-1, 3, 3) @ self._axes[:, :, None]
        turning = jacobians[8:, 1]
        turning = turning[:, _NEXT] * axes[:, _LAST] - turning[:, _LAST] * axes[:, _NEXT]

        torso = data.xmat[self._torso[0]].reshape(3, 3) @ self._torso_axes
        directions = np.concatenate([bones, axes[:, :, 0], hands[None]])[_ORDER] @ torso
        jacobian = torso.T @ np.concatenate([moving, turning, parting[None]])[_ORDER] * self._below_torso
        return directions, jacobian.reshape(-1, len(angles))

    def _clear(self, previous: np.ndarray, angles: np.ndarray) -> np.ndarray:
        """The angles; where the robot would touch itself, joints go no farther than they can."""
        touching = self._clearance.under(angles, 0.0)
        if not touching:
            return angles
        backed = np.any([self._clearance.joints(pair) for pair in touching], axis=0)
        shares = np.where(backed, np.arange(BACKWARD_STEPS)[::-1, None] / BACKWARD_STEPS, 1.0)
        poses = previous + shares * (angles - previous)
        return next((pose for pose in poses if not self._clearance.under(pose, 0.0)), previous)

    def _end_points(self) -> np.ndarray:
        """(4, 3) ends of the bones in the base frame [m]."""
        data = self._kinematics.data
        turned = data.xmat[self._children].reshape(-1, 3, 3) @ self._ends[:, :, None]
        return data.xpos[self._children] + turned[:, :, 0]

    def _lengths(self) -> np.ndarray:
        """(4,) of the bones [m]."""
        return np.linalg.norm(self._end_points() - self._kinematics.data.xpos[self._parents], axis=1)

    def _check_bones(self) -> None:
        model, starts = self._kinematics.model, self._kinematics.data.xpos[self._parents]
        bones = zip(self._parents, self._children, starts, self._end_points(), strict=True)
        for parent, child, start, end in bones:
            if np.allclose(start, end):
                names = [model.body(link).name for link in (parent, child)]
                raise RobotError("an arm is mapped to two links that lie on one point", names)

    def _links(self, *names: str) -> np.ndarray:
        return np.array([self._kinematics.link(name) for name in names])


def _weights_of_hands(targets: np.ndarray) -> np.ndarray:
    """(3,) of the squared errors of the hands: the more, the nearer they are. None if an arm is not seen."""
    seen = np.linalg.norm(targets[_FOREARMS], axis=1).prod()
    contact = CONTACT * np.exp(-(targets[-1] @ targets[-1]) / TOUCHING**2)
    return seen * (contact + np.array([0.0, 0.0, HEIGHT]))


def _bounded_step(
    hessian: np.ndarray, gradient: np.ndarray, lowest: np.ndarray, highest: np.ndarray
) -> np.ndarray:
    """The step that minimises the quadratic. Where it would leave its bounds it is held, and solved again."""
    held = np.zeros(len(gradient), bool)
    step = np.linalg.solve(hessian, -gradient)
    while (outside := (step < lowest) | (step > highest)).any():
        held |= outside
        fixed = np.where(held, np.clip(step, lowest, highest), 0.0)
        reduced = np.where(held | held[:, None], np.diag(held), hessian)
        step = np.linalg.solve(reduced, np.where(held, fixed, -gradient - hessian @ fixed))
    return step
