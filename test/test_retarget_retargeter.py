"""Clips become one motion without a jump, inside the limits, whatever is re-planned."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.frames import KeypointClip, frame_time
from gesture_bot.base.keypoints import INDEX, KEYPOINTS
from gesture_bot.retarget.directions import directions
from gesture_bot.retarget.reach import BONES, angle_between
from gesture_bot.retarget.retargeter import Retargeter
from gesture_bot.retarget.robot import load_robot
from gesture_bot.retarget.solver import DirectionSolver

ROBOT = load_robot("toa")
EPOCH = 26_460_000_007
"""A frame of the present."""


def speaker(frames, speed=1.0):
    """Keypoints of somebody who gestures with both arms, differently, and moves the head: (n, 17, 3)."""
    t = np.arange(frames)[:, None] / 15 * speed
    keypoints = np.zeros((frames, len(KEYPOINTS), 3))

    def put(name, parent, *vector):
        vector = np.concatenate([np.broadcast_to(part, t.shape) for part in vector], axis=1)
        keypoints[:, INDEX[name]] = keypoints[:, INDEX[parent]] + vector if parent else vector

    put("spine", "", 0, 0, 0.25)
    put("neck", "", 0.02 * np.sin(t), 0, 0.5)
    put("head", "neck", 0.02, 0.02 * np.sin(0.7 * t), 0.12)
    put("head_top", "head", 0.03, 0.03 * np.sin(0.7 * t), 0.16)
    for side, sign, phase in (("left", 1, 0.0), ("right", -1, 1.3)):
        swing, lift = np.sin(2.1 * t + phase), np.sin(1.3 * t + 2 * phase)
        put(f"{side}_shoulder", "neck", 0, 0.18 * sign, -0.03)
        put(f"{side}_elbow", f"{side}_shoulder", 0.1 * lift, sign * (0.1 + 0.05 * swing), -0.26)
        put(f"{side}_wrist", f"{side}_elbow", 0.18, -0.1 * sign * swing, 0.1 + 0.1 * lift)
        put(f"{side}_index", f"{side}_wrist", 0.07, 0.02 * np.cos(t), 0.03)
        put(f"{side}_little", f"{side}_wrist", 0.06, -0.02 * np.cos(t), -0.03)
    return keypoints


def played(trajectories):
    """Positions and velocities tick by tick; each trajectory replaces those before it from its start on."""
    ticks = {}
    for trajectory in trajectories:
        first = round(trajectory.times[0] * 50)
        ticks = {tick: state for tick, state in ticks.items() if tick < first}
        for tick, *state in zip(
            range(first, first + len(trajectory.times)),
            trajectory.positions,
            trajectory.velocities,
            strict=True,
        ):
            ticks[tick] = state
    assert (np.diff(sorted(ticks)) == 1).all()
    return np.array([ticks[tick] for tick in sorted(ticks)]).transpose(1, 0, 2)


def assert_smooth_and_inside_limits(positions, velocities):
    limits = ROBOT.limits
    assert (positions >= limits.lower - 1e-12).all()
    assert (positions <= limits.upper + 1e-12).all()
    assert (np.abs(velocities) <= limits.velocity + 1e-12).all()
    assert (np.abs(np.diff(velocities, axis=0)) <= limits.acceleration / 50 + 1e-12).all()
    np.testing.assert_allclose(
        np.diff(positions, axis=0), (velocities[1:] + velocities[:-1]) / 100, atol=1e-12
    )


@pytest.mark.parametrize("speed", [1.0, 6.0])
def test_a_stream_of_windows_is_one_motion_inside_the_limits(speed):
    retargeter, keypoints = Retargeter(ROBOT), speaker(160, speed)
    trajectories = [
        retargeter.push(KeypointClip(EPOCH + max(start - 4, 0), keypoints[max(start - 4, 0) : start + 8]))
        for start in range(0, 160, 8)
    ]
    positions, velocities = played(trajectories)
    np.testing.assert_allclose(positions[0], ROBOT.rest, atol=1e-12)
    np.testing.assert_array_equal(velocities[-1], 0)
    assert_smooth_and_inside_limits(positions, velocities)


def test_a_live_stream_of_single_frames_does_not_stop_and_go():
    keypoints, retargeter = speaker(120), Retargeter(ROBOT)
    whole = Retargeter(ROBOT).push(KeypointClip(EPOCH, keypoints))
    positions, velocities = played(
        retargeter.push(KeypointClip(EPOCH + frame, keypoints[frame : frame + 1])) for frame in range(120)
    )
    assert_smooth_and_inside_limits(positions, velocities)
    # It is the same motion, 0.2 s later.
    late, whole_positions = slice(85, 360), whole.positions[75:350]
    assert np.abs(positions[late] - whole_positions).max() < 0.03
    speeds = np.linalg.norm(velocities[late], axis=1)
    assert (speeds > 0.8 * np.linalg.norm(whole.velocities[75:350], axis=1)).all()


def test_a_jump_at_the_end_of_a_clip_is_not_gone_on_with():
    keypoints = np.repeat(speaker(60)[[0, 40]], 8, axis=0)
    trajectory = Retargeter(ROBOT).push(KeypointClip(EPOCH, keypoints[:9]))
    held = Retargeter(ROBOT).push(KeypointClip(EPOCH, keypoints))
    assert np.abs(held.positions[-1] - held.positions[0]).max() > 0.3
    between = np.sort([held.positions[0], held.positions[-1]], axis=0)
    assert (trajectory.positions[-1] > between[0] - 0.05).all()
    assert (trajectory.positions[-1] < between[1] + 0.05).all()


def test_unrelated_windows_are_joined_without_a_jump():
    retargeter, keypoints = Retargeter(ROBOT), speaker(400, 3.0)
    starts = np.random.default_rng(0).permutation(50)[:25] * 8
    trajectories = [
        retargeter.push(KeypointClip(EPOCH + 8 * i, keypoints[start : start + 8]))
        for i, start in enumerate(starts)
    ]
    assert_smooth_and_inside_limits(*played(trajectories))


def test_the_robot_is_where_the_person_is_at_each_frame():
    retargeter, keypoints = Retargeter(ROBOT), speaker(90)
    trajectory = retargeter.push(KeypointClip(EPOCH, keypoints))
    posed = Retargeter(ROBOT)
    for frame in (30, 50, 70):
        posed.reset(trajectory.at(frame_time(EPOCH + frame))[0])
        held = posed.push(KeypointClip(0, np.repeat(keypoints[frame : frame + 1], 10, axis=0)))
        assert np.abs(held.positions[-1] - held.positions[0]).max() < 0.05


def test_the_robot_is_not_jerkier_than_a_person_seen_by_a_camera():
    seen = speaker(150, 1.5) + np.random.default_rng(0).normal(scale=0.002, size=(150, len(KEYPOINTS), 3))
    plan = Retargeter(ROBOT).push(KeypointClip(0, seen))
    ticks = np.arange(50, 450)
    person = directions(CubicSpline(np.arange(150), seen)(ticks * 15 / 50))
    solver = DirectionSolver(ROBOT)
    robot = np.array([solver.reached(plan.positions[tick]) for tick in ticks])
    persons, robots = (
        np.linalg.norm(np.diff(rows[:, BONES], 3, axis=0), axis=-1).mean() for rows in (person, robot)
    )
    assert robots < 0.5 * persons
    assert np.median(angle_between(robot[:, BONES], person[:, BONES])) < 1


def test_points_come_every_20_ms_from_the_first_frame_to_rest():
    trajectory = Retargeter(ROBOT).push(KeypointClip(EPOCH, speaker(8)))
    assert trajectory.joints == ROBOT.joints
    assert 0 <= trajectory.times[0] - frame_time(EPOCH) < 0.02
    np.testing.assert_allclose(np.diff(trajectory.times), 0.02, atol=1e-6)
    assert trajectory.times[-1] >= frame_time(EPOCH + 7)
    np.testing.assert_array_equal(trajectory.velocities[-1], 0)


def test_a_new_plan_goes_on_exactly_from_the_old_one():
    retargeter, keypoints = Retargeter(ROBOT), speaker(40)
    before = retargeter.push(KeypointClip(EPOCH, keypoints[:24]))
    after = retargeter.push(KeypointClip(EPOCH + 11, keypoints[30:38]))
    seam = np.searchsorted(before.times, after.times[0])
    assert before.times[seam] == after.times[0]
    np.testing.assert_array_equal(after.positions[0], before.positions[seam])
    np.testing.assert_array_equal(after.velocities[0], before.velocities[seam])


def test_the_same_frames_again_change_nothing_to_speak_of():
    retargeter, keypoints = Retargeter(ROBOT), speaker(60)
    before = retargeter.push(KeypointClip(EPOCH, keypoints))
    after = retargeter.push(KeypointClip(EPOCH + 30, keypoints[30:]))
    both = min(len(before.times) - np.searchsorted(before.times, after.times[0]), len(after.times))
    np.testing.assert_allclose(
        after.positions[: both - 20], before.positions[-both:-20][: both - 20], atol=2e-3
    )


def test_after_a_gap_the_robot_starts_from_where_it_rests():
    retargeter, keypoints = Retargeter(ROBOT), speaker(16)
    before = retargeter.push(KeypointClip(EPOCH, keypoints[:8]))
    after = retargeter.push(KeypointClip(EPOCH + 1000, keypoints[8:]))
    np.testing.assert_array_equal(after.positions[0], before.positions[-1])
    np.testing.assert_array_equal(after.velocities[0], 0)


def test_it_starts_where_the_joints_are():
    retargeter = Retargeter(ROBOT)
    start = 0.5 * (ROBOT.limits.lower + ROBOT.limits.upper)
    retargeter.reset(start)
    trajectory = retargeter.push(KeypointClip(EPOCH, speaker(30)))
    np.testing.assert_array_equal(trajectory.positions[0], start)
    assert_smooth_and_inside_limits(trajectory.positions, trajectory.velocities)


def test_joints_that_start_outside_their_limits_come_back_inside():
    retargeter = Retargeter(ROBOT)
    retargeter.reset(ROBOT.limits.upper + 3.0)
    trajectory = retargeter.push(KeypointClip(EPOCH, speaker(8)))
    assert (np.diff(np.maximum(trajectory.positions - ROBOT.limits.upper, 0), axis=0) <= 0).all()
    assert (trajectory.positions[-1] <= ROBOT.limits.upper).all()


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e300])
def test_bad_keypoints_are_named_and_change_nothing(bad):
    keypoints, twins = speaker(24), (Retargeter(ROBOT), Retargeter(ROBOT))
    for retargeter in twins:
        retargeter.push(KeypointClip(EPOCH, keypoints[:8]))
    broken = keypoints[8:16].copy()
    broken[3, INDEX["left_wrist"], 1] = bad
    with pytest.raises(InvalidValueError, match=f"frame {EPOCH + 11} .*left_wrist"):
        twins[0].push(KeypointClip(EPOCH + 8, broken))
    for shape in ((0, 17, 3), (8, 16, 3)):
        with pytest.raises(InvalidValueError, match="shape"):
            twins[0].push(KeypointClip(EPOCH + 8, np.zeros(shape)))
    with pytest.raises(InvalidValueError, match="start position"):
        twins[0].reset(np.full(12, np.nan))
    after = [retargeter.push(KeypointClip(EPOCH + 8, keypoints[8:])) for retargeter in twins]
    np.testing.assert_array_equal(after[0].positions, after[1].positions)
    np.testing.assert_array_equal(after[0].velocities, after[1].velocities)
