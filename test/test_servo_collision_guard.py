"""The robot does not touch itself, whatever the joints are asked for."""

import numpy as np
import pytest
from servo_bus import simulated_bus

from gesture_bot.base.trajectory import JointTrajectory
from gesture_bot.retarget.clearance import Clearance
from gesture_bot.retarget.robot import load_robot
from gesture_bot.servo.collision_guard import LEAST, CollisionGuard
from gesture_bot.servo.driver import Driver
from gesture_bot.servo.envelope import Envelope

DT = 0.01
ROBOT = load_robot("toa")
CLEARANCE = Clearance(ROBOT)
JOINTS = {name: column for column, name in enumerate(ROBOT.joints)}
SLACK = 1e-4
"""By so much rounding may differ [m]."""


def pose(**angles):
    """The rest pose but for some joints [rad]."""
    positions = ROBOT.rest.copy()
    for joint, angle in angles.items():
        positions[JOINTS[joint]] = angle
    return positions


ACROSS = {"shoulder_pitch": -0.4, "shoulder_roll": 0.0, "upper_arm_yaw": -1.3, "elbow": 1.6}
"""An arm of which the forearm lies across the chest."""


def across(side):
    return {f"{side}_{joint}": angle for joint, angle in ACROSS.items()}


def distances(path):
    return np.array([CLEARANCE.nearest(positions).distance for positions in path])


def guarded(start=ROBOT.rest):
    return Envelope(ROBOT.limits, DT, start, CollisionGuard(ROBOT, DT))


def run(envelope, target, seconds):
    still = np.zeros(len(ROBOT.joints))
    return np.array([envelope.step(target, still) for _ in range(round(seconds / DT))])


def adversarial(envelope):
    """Where it goes when asked for one random pose after the other, faster than it can follow."""
    random = np.random.default_rng(3)
    poses = random.uniform(ROBOT.limits.lower, ROBOT.limits.upper, (60, len(ROBOT.joints)))
    return np.concatenate([run(envelope, target, random.uniform(0.1, 1.0)) for target in poses])


@pytest.fixture(scope="module")
def path():
    return adversarial(guarded())


def test_random_demands_never_let_the_robot_touch_itself(path):
    assert distances(path).min() > LEAST - SLACK
    assert np.ptp(path, axis=0).min() > 0.5, "although all joints move far"
    assert distances(adversarial(Envelope(ROBOT.limits, DT, ROBOT.rest))).min() < 0, "as they would"


def test_braking_for_it_stays_inside_the_limits(path):
    velocity = np.diff(path, axis=0) / DT
    assert (np.abs(velocity) <= ROBOT.limits.velocity + 1e-9).all()
    assert (np.abs(np.diff(velocity, axis=0)) <= ROBOT.limits.acceleration * DT + 1e-9).all()
    assert (path >= ROBOT.limits.lower).all() and (path <= ROBOT.limits.upper).all()


def test_an_arm_that_would_touch_waits_and_the_other_goes_on():
    into_the_chest = pose(**across("left"), right_elbow=1.2)
    assert CLEARANCE.nearest(into_the_chest).distance < 0
    envelope = guarded()
    path = run(envelope, into_the_chest, 4.0)
    assert LEAST - SLACK < distances(path[-1:])[0] < 0.05
    assert path[-1][JOINTS["right_elbow"]] == pytest.approx(1.2, abs=1e-3)
    assert envelope.interventions.collision > 0
    back = run(envelope, ROBOT.rest, 3.0)
    np.testing.assert_allclose(back[-1], ROBOT.rest, atol=1e-3)


def test_what_touches_at_the_start_comes_free_but_not_closer():
    deeper = pose(**across("left"))
    start = deeper + 0.3 * (ROBOT.rest - deeper)
    inside = distances([start])[0]
    assert distances([deeper])[0] < inside < 0
    envelope = guarded(start)
    assert distances(run(envelope, deeper, 1.0)).min() > inside - SLACK
    freed = distances(run(envelope, ROBOT.rest, 3.0))
    assert freed.min() > inside - SLACK and freed[-1] > LEAST
    assert distances(run(envelope, start, 3.0)).min() > LEAST - SLACK, "and does not go back"


def test_goals_on_the_bus_keep_the_hands_off_each_other():
    driver = Driver(ROBOT, simulated_bus(ROBOT).port)
    driver.start()
    asked = pose(**across("left"), **across("right"))
    path = np.stack([ROBOT.rest, asked])
    driver.set_trajectory(JointTrajectory(ROBOT.joints, np.array([1000.0, 1002.0]), path, 0 * path))
    measured = [driver.tick(1000.0 + k * DT).positions for k in range(500)]
    driver.close()
    assert driver.status.interventions.collision > 0
    assert distances(measured).min() > 0
