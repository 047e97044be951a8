"""An operator's joints, without ROS: what is asked of the robot, whatever the operator does."""

from dataclasses import replace

import numpy as np
import pytest

from gesture_bot.base.errors import FileFormatError, InvalidValueError
from gesture_bot.base.files import config_dir
from gesture_bot.retarget.kinematics import arm_joints
from gesture_bot.retarget.robot import load_robot
from gesture_bot.servo.gamepad import load_gamepad
from gesture_bot.servo.jog import LEASH, PERIOD, USED, Jog

ROBOT = load_robot("toa")
LIMITS = ROBOT.limits
ELBOW = ROBOT.joints.index("left_elbow")
T0 = 1.7e9


def test_a_restless_operator_stays_smooth_and_inside_the_limits():
    rng = np.random.default_rng(3)
    jog, measured = Jog(LIMITS), ROBOT.rest.copy()
    jog.take(ROBOT.joints, measured)
    before = None
    for tick in range(600):
        if rng.random() < 0.1:
            joint = str(rng.choice(ROBOT.joints))
            if rng.random() < 0.5:
                jog.move({joint: rng.uniform(-2, 2)})
            else:
                jog.go({joint: rng.uniform(-5, 5)})
        plan = jog.tick(T0 + tick * PERIOD, measured)
        assert (plan.positions >= LIMITS.lower).all() and (plan.positions <= LIMITS.upper).all()
        assert (np.abs(plan.velocities) <= USED * LIMITS.velocity + 1e-9).all()
        accelerations = np.abs(np.diff(plan.velocities, axis=0)) / np.diff(plan.times)[:, None]
        # Times since the epoch are rounded to 0.2 us.
        assert (accelerations <= 1.0001 * USED * LIMITS.acceleration).all()
        assert not plan.velocities[-1].any(), "it ends at rest when nothing follows it"
        if before is not None:
            moved, was, speed = plan.positions[0] - measured, before.velocities[0], plan.velocities[0]
            np.testing.assert_allclose(moved, PERIOD * (was + speed) / 2, atol=1e-9, err_msg="a step")
            assert (np.abs(speed - was) <= 1.0001 * USED * LIMITS.acceleration * PERIOD).all()
        before, measured = plan, plan.positions[0]


def test_it_starts_where_the_joint_is_and_moves_that_one_alone():
    jog, measured = Jog(LIMITS), ROBOT.rest + 0.05
    assert jog.tick(T0, measured) is None
    jog.take(["left_elbow"], measured)
    jog.go({"left_elbow": 1.2})
    plan = jog.tick(T0, measured)
    assert plan.joints == ("left_elbow",)
    assert plan.positions[0] == pytest.approx(measured[ELBOW], abs=0.03)
    for tick in range(1, 60):
        plan = jog.tick(T0 + tick * PERIOD, measured)
        measured[ELBOW] = plan.positions[0, 0]
    assert measured[ELBOW] == pytest.approx(1.2, abs=1e-6)
    jog.give_back(["left_elbow"])
    assert jog.tick(T0 + 3, measured) is None


def test_a_blocked_joint_is_not_asked_to_go_farther_and_comes_back_at_once():
    jog, measured = Jog(LIMITS), ROBOT.rest.copy()
    jog.take(["left_elbow"], measured)
    jog.move({"left_elbow": 1.0})
    for tick in range(100):
        plan = jog.tick(T0 + tick * PERIOD, measured)
    braking = (USED * LIMITS.velocity[ELBOW]) ** 2 / (2 * USED * LIMITS.acceleration[ELBOW])
    assert LEASH < plan.positions[0, 0] - measured[ELBOW] < LEASH + braking + 0.1
    jog.move({"left_elbow": -1.0})
    turned = jog.tick(T0 + 100 * PERIOD, measured)
    assert turned.velocities[1, 0] < 0
    measured[ELBOW] = np.nan
    for tick in range(101, 120):
        turned = jog.tick(T0 + tick * PERIOD, measured)
    assert not turned.velocities.any(), "nobody knows where it is"


def test_time_that_was_missed_is_no_motion():
    jog, measured = Jog(LIMITS), ROBOT.rest.copy()
    jog.take(["left_elbow"], measured)
    jog.move({"left_elbow": 0.3})
    first = jog.tick(T0, measured)
    late = jog.tick(T0 + 5.0, measured)
    assert late.times[0] == pytest.approx(T0 + 5.0 + PERIOD)
    assert abs(late.positions[0, 0] - first.positions[0, 0]) < 0.1


def test_what_cannot_be_moved_is_named():
    jog = Jog(LIMITS)
    with pytest.raises(InvalidValueError, match=r"'left_elbo'; valid: .*left_elbow"):
        jog.take(["left_elbo"], ROBOT.rest)
    with pytest.raises(InvalidValueError, match="'left_elbow'"):
        jog.take(["left_elbow"], np.full(len(ROBOT.joints), np.nan))
    with pytest.raises(InvalidValueError, match="'left_elbow'"):
        jog.move({"left_elbow": 1.0})
    assert jog.tick(T0, ROBOT.rest) is None


def test_an_arms_joints_go_from_the_shoulder_on_whatever_the_servo_tables_order():
    order = np.random.default_rng(0).permutation(len(ROBOT.joints))
    limits = replace(
        LIMITS,
        joints=tuple(ROBOT.joints[i] for i in order),
        **{name: getattr(LIMITS, name)[order] for name in ("lower", "upper", "velocity", "acceleration")},
    )
    arms = arm_joints(replace(ROBOT, limits=limits, rest=ROBOT.rest[order]))
    for side, joints in arms.items():
        assert joints == tuple(
            f"{side}_{part}"
            for part in ("shoulder_pitch", "shoulder_roll", "upper_arm_yaw", "elbow", "wrist")
        )


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("stop: 1 ", "stop: 9 ", "button 9 is both `stop` and the deadman of the left arm"),
        ("{axis: 1}", "{axes: 1}", r"left_arm\.joints\.0"),
        ("speed: 0.25", "speed: 25", "speed.*less than or equal to 0.6"),
    ],
)
def test_a_mistake_in_an_assignment_is_named(tmp_path, old, new, said):
    text = (config_dir() / "joy.yaml").read_text()
    assert old in text
    (tmp_path / "mine.yaml").write_text(text.replace(old, new, 1))
    with pytest.raises(FileFormatError, match=rf"mine.yaml: line \d+.*{said}"):
        load_gamepad(str(tmp_path / "mine.yaml"))
