"""Directions tell the pose, whatever the body's size and heading, and the solver imitates them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gesture_bot.base.keypoints import INDEX, KEYPOINTS, mirror
from gesture_bot.retarget.directions import DIRECTIONS, directions
from gesture_bot.retarget.robot import load_robot
from gesture_bot.retarget.solver import DirectionSolver

FORWARD, LEFT, UP = np.eye(3)
IN, OUT = -LEFT, LEFT
"""For the left arm. The right arm gets the same pose, mirrored."""

POSES = {
    "hanging": (-UP, -UP, IN),
    "forearms forward, palms up": (-UP, FORWARD, UP),
    "forearms forward, palms down": (-UP, FORWARD, -UP),
    "arms forward": (FORWARD, FORWARD, IN),
    "hands up, palms forward": (OUT - UP, UP, FORWARD),
    "arms wide": (OUT - 0.2 * UP, OUT + FORWARD, FORWARD + IN),
    "hands before the chest": (FORWARD + OUT - 3 * UP, FORWARD + IN + UP, IN - FORWARD),
}


def unit(vector):
    return vector / np.linalg.norm(vector)


def person(upper_arm, forearm, palm, size=1.0):
    """Keypoints of somebody who holds both arms alike, the left one as given."""
    upper_arm, forearm = unit(upper_arm), unit(forearm)
    palm = unit(palm - palm @ forearm * forearm)
    thumb = np.cross(palm, forearm)
    at = {
        "pelvis": 0 * UP,
        "spine": 0.25 * UP,
        "neck": 0.5 * UP,
        "head": (0.02, 0, 0.62),
        "head_top": (0.05, 0, 0.78),
    }
    at["left_hip"], at["left_shoulder"] = 0.1 * LEFT - 0.05 * UP, 0.18 * LEFT + 0.47 * UP
    at["left_elbow"] = at["left_shoulder"] + 0.29 * upper_arm
    at["left_wrist"] = at["left_elbow"] + 0.25 * forearm
    at["left_index"] = at["left_wrist"] + 0.075 * forearm + 0.028 * thumb
    at["left_little"] = at["left_wrist"] + 0.068 * forearm - 0.03 * thumb
    keypoints = np.array([at.get(name, (0, 0, 0)) for name in KEYPOINTS], float)
    right = [INDEX[name] for name in KEYPOINTS if name.startswith("right")]
    keypoints[right] = mirror(keypoints)[right]
    return size * keypoints


@pytest.mark.parametrize("pose", POSES)
def test_directions_are_those_of_the_pose(pose):
    upper_arm, forearm, palm = map(unit, POSES[pose])
    found = dict(zip(DIRECTIONS, directions(person(*POSES[pose])), strict=True))
    across = unit(palm - palm @ forearm * forearm)
    np.testing.assert_allclose(found["left_upper_arm"], upper_arm, atol=1e-9)
    np.testing.assert_allclose(found["left_forearm"], forearm, atol=1e-9)
    np.testing.assert_allclose(found["left_palm"], across, atol=1e-9)
    np.testing.assert_allclose(found["right_palm"], across * (1, -1, 1), atol=1e-9)
    np.testing.assert_allclose(found["face"], FORWARD, atol=0.01)


def test_directions_ignore_size_and_where_the_torso_faces():
    keypoints = np.array([person(*pose) for pose in POSES.values()])
    turned = (
        Rotation.from_euler("zyx", (0.8, 0.4, -0.2))
        .apply(1.7 * keypoints.reshape(-1, 3))
        .reshape(keypoints.shape)
    )
    np.testing.assert_allclose(directions(turned), directions(keypoints), atol=1e-9)


def test_the_face_turns_and_nods_with_the_top_of_the_head():
    keypoints = person(*POSES["hanging"])
    left, down = keypoints.copy(), keypoints.copy()
    left[INDEX["head_top"]] += 0.03 * LEFT
    down[INDEX["head_top"]] += 0.10 * FORWARD - 0.03 * UP
    face = DIRECTIONS.index("face")
    assert directions(left)[face] @ LEFT > 0.2
    assert directions(down)[face] @ UP < -0.2


@pytest.mark.parametrize("pose", POSES)
def test_the_solver_points_the_robots_links_as_the_persons(pose):
    robot = load_robot("toa")
    solver = DirectionSolver(robot)
    targets = directions(person(*POSES[pose]))
    angles = robot.rest
    for _ in range(10):
        angles = solver.solve(targets, angles)
    cosines = np.sum(solver.reached(angles) * targets, axis=1)[:-1]
    assert np.degrees(np.arccos(np.clip(cosines, -1, 1))).max() < 3.0
    assert (angles >= robot.limits.lower - 1e-9).all()
    assert (angles <= robot.limits.upper + 1e-9).all()
    # Both arms do the same, and toa's joints are mirror images.
    np.testing.assert_allclose(angles[:5], angles[5:10], atol=1e-6)


def test_hands_that_touch_come_closer_than_directions_alone_bring_them():
    toa = load_robot("toa")
    wide = toa.urdf.replace("0 0.125 0.17", "0 0.16 0.17").replace("0 -0.125 0.17", "0 -0.16 0.17")
    solver, rest = DirectionSolver(replace(toa, urdf=wide)), toa.rest
    touching = directions(person(FORWARD + 0.6 * OUT - 3 * UP, FORWARD + 1.1 * IN, IN))
    apart = touching.copy()
    apart[-1] = 2 * LEFT
    angles = [rest, rest]
    for _ in range(10):
        angles = [solver.solve(*ask) for ask in zip((touching, apart), angles, strict=True)]
    near, alone = (np.linalg.norm(solver.reached(pose)[-1]) for pose in angles)
    assert np.linalg.norm(touching[-1]) < near < 0.9 * alone


def test_a_pose_out_of_reach_is_approached_inside_the_limits():
    robot = load_robot("toa")
    solver = DirectionSolver(robot)
    angles = robot.rest
    behind = directions(person(-FORWARD - IN, IN - FORWARD, UP))
    for _ in range(20):
        angles = solver.solve(behind, angles)
        assert (angles >= robot.limits.lower - 1e-9).all()
        assert (angles <= robot.limits.upper + 1e-9).all()


def test_a_straight_arm_does_not_spin_about_itself():
    robot = load_robot("toa")
    solver = DirectionSolver(robot)
    rng = np.random.default_rng(0)
    angles, path = robot.rest, []
    for _ in range(100):
        forearm = unit(FORWARD - 0.3 * UP + rng.normal(0, 0.02, 3))
        angles = solver.solve(directions(person(FORWARD - 0.3 * UP, forearm, IN)), angles)
        path.append(angles)
    assert np.abs(np.diff(path[10:], axis=0)).max() < 0.15


def test_coinciding_keypoints_leave_the_arm_where_it_was():
    robot = load_robot("toa")
    solver = DirectionSolver(robot)
    targets = directions(np.zeros((17, 3)))
    np.testing.assert_allclose(solver.solve(targets, robot.rest)[:10], robot.rest[:10], atol=0.02)
