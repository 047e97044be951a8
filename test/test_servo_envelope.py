"""The safety envelope: whatever is asked for, what leaves it is inside the limits."""

import numpy as np
import pytest

from gesture_bot.retarget.follower import JointLimits
from gesture_bot.servo.envelope import MET, Envelope

DT = 0.01
LIMITS = JointLimits(
    ("a", "b"), np.array([-1.0, -2.0]), np.array([1.0, 0.5]), np.array([3.0, 2.0]), np.array([20.0, 10.0])
)
START = np.array([0.2, -0.3])
STILL = np.zeros(2)


def follow(envelope, targets, speeds):
    return np.array([START, *(envelope.step(p, v) for p, v in zip(targets, speeds, strict=True))])


def assert_inside(path):
    velocity = np.diff(path, axis=0) / DT
    assert (path >= LIMITS.lower - 1e-9).all() and (path <= LIMITS.upper + 1e-9).all()
    assert (np.abs(velocity) <= LIMITS.velocity + 1e-9).all()
    assert (np.abs(np.diff(velocity, axis=0)) <= LIMITS.acceleration * DT + 1e-9).all()


@pytest.mark.parametrize("seed", range(5))
def test_random_demands_with_gaps_stay_inside(seed):
    random = np.random.default_rng(seed)
    targets = random.normal(scale=3.0, size=(2000, 2)).repeat(random.integers(1, 30), axis=0)[:2000]
    speeds = random.normal(scale=10.0, size=(2000, 2))
    targets[random.random((2000, 2)) < 0.1] = np.nan
    speeds[random.random((2000, 2)) < 0.1] = np.inf
    envelope = Envelope(LIMITS, DT, START)
    assert_inside(follow(envelope, targets, speeds))
    assert envelope.interventions.position > 0


def test_motion_inside_the_limits_passes_unchanged():
    t = np.arange(1, 500)[:, None] * DT
    targets = START + [0.3, -0.2] * (1 - np.cos(2 * t))
    speeds = [0.6, -0.4] * np.sin(2 * t)
    envelope = Envelope(LIMITS, DT, START)
    path = follow(envelope, targets, speeds)
    np.testing.assert_allclose(path[1:], targets, atol=1e-4)
    counts = envelope.interventions
    assert (counts.position, counts.velocity, counts.acceleration) == (0, 0, 0)


def test_what_is_not_a_number_is_answered_with_braking_of_that_joint_alone():
    envelope = Envelope(LIMITS, DT, START)
    for k in range(20):
        envelope.step(START + (k + 1) * DT, np.ones(2))
    before = envelope.positions.copy()
    for k in range(20, 60):
        envelope.step(np.array([np.nan, START[1] + (k + 1) * DT]), np.ones(2))
    # 1 rad/s against 20 rad/s^2: rest within 50 ms and 25 mm on the arc.
    assert envelope.velocities == pytest.approx([0.0, 1.0], abs=0.02)
    assert before[0] < envelope.positions[0] < before[0] + 0.03
    assert envelope.positions[1] == pytest.approx(START[1] + 0.6, abs=1e-3)


def test_each_kind_of_intervention_is_counted():
    asked = {
        "position": ([2.0, 0.0], STILL),
        "velocity": ([0.5, 0.0], [9.0, 0.0]),
        "acceleration": ([0.5, 0.0], STILL),
    }
    for kind, (target, speed) in asked.items():
        envelope = Envelope(LIMITS, DT, START)
        envelope.step(START, STILL)
        for _ in range(3):
            envelope.step(np.array(target), np.array(speed))
        counts = vars(envelope.interventions)
        assert counts[kind] > 0, kind


def test_a_far_target_is_approached_slowly_once():
    envelope = Envelope(LIMITS, DT, START)
    target = START + [-1.0, 0.0]
    approach = follow(envelope, [target] * 300, [STILL] * 300)
    far = np.abs(approach[1:, 0] - target[0]) > MET
    assert np.abs(np.diff(approach[:, 0]))[far].max() / DT == pytest.approx(0.5)
    assert abs(approach[-1, 0] - target[0]) < MET
    back = follow(envelope, [START] * 100, [STILL] * 100)[1:]
    assert np.abs(np.diff(back[:, 0])).max() / DT > 2.0
