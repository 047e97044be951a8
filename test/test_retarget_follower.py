"""The follower stays inside its limits whatever it is asked, and tracks what can be tracked."""

import numpy as np
import pytest

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.retarget.follower import Follower, JointLimits

DT = 0.02
LIMITS = JointLimits(
    tuple("abcdefghijkl"),
    lower=np.linspace(-2.0, -0.1, 12),
    upper=np.linspace(0.2, 3.0, 12),
    velocity=np.linspace(0.3, 6.0, 12),
    acceleration=np.linspace(40.0, 2.0, 12),
)
MIDDLE = 0.5 * (LIMITS.lower + LIMITS.upper)


def largest_excess(positions, velocities):
    """How far positions, velocities and accelerations go beyond the limits, at ticks and between."""
    accelerations = np.diff(velocities, axis=0) / DT
    # The acceleration is constant within a tick: the turning point of the parabola may lie inside.
    moment = np.clip(-velocities[:-1] / np.where(accelerations == 0, 1, accelerations), 0, DT)
    between = positions[:-1] + moment * velocities[:-1] + 0.5 * moment**2 * accelerations
    inside = np.concatenate([positions, between])
    np.testing.assert_allclose(
        np.diff(positions, axis=0), DT * (velocities[1:] + velocities[:-1]) / 2, atol=1e-12
    )
    return {
        "position": max((LIMITS.lower - inside).max(), (inside - LIMITS.upper).max()),
        "velocity": (np.abs(velocities) - LIMITS.velocity).max(),
        "acceleration": (np.abs(accelerations) - LIMITS.acceleration).max(),
    }


def adversarial_targets(steps, rng):
    """Jumps, chirps, drifts and noise, far outside the limits too, with velocities that fit them or lie."""
    position, velocity = rng.normal(size=(2, 12))
    for step in range(steps):
        kind = (step // 500) % 5
        if kind == 0 and step % rng.integers(1, 30) == 0:
            position, velocity = rng.uniform(-5, 5, 12), np.zeros(12)
        elif kind == 1:
            position, velocity = rng.uniform(-5, 5, 12), rng.normal(0, 20, 12)
        elif kind == 2:
            phase = 1e-3 * (step % 500) ** 2 * np.linspace(0.1, 3, 12)
            position, velocity = 3 * np.sin(phase), 3 * np.cos(phase)
        elif kind == 3:
            position, velocity = (
                np.where(rng.random(12) < 0.5, LIMITS.lower, LIMITS.upper),
                rng.normal(0, 9, 12),
            )
        elif kind == 4:
            position = MIDDLE + rng.normal(0, 1e-6, 12)
        if step % 997 == 0:
            position, velocity = rng.choice([-1, 1], (2, 12)) * 1e308
        yield position, velocity


def test_limits_hold_against_adversarial_targets():
    rng = np.random.default_rng(1)
    follower = Follower(LIMITS, DT, MIDDLE)
    states = [(follower.position, follower.velocity)]
    for position, velocity in adversarial_targets(100_000, rng):
        states.append(follower.brake() if rng.random() < 0.02 else follower.step(position, velocity))
    positions, velocities = np.array(states).transpose(1, 0, 2)
    excess = largest_excess(positions, velocities)
    assert excess["position"] <= 1e-12
    assert excess["velocity"] <= 1e-12
    assert excess["acceleration"] <= 1e-9
    assert (positions.max(axis=0) - LIMITS.upper > -1e-9).all(), "the targets never pushed against the limits"


def test_a_target_at_rest_is_reached_exactly_without_overshoot_or_chatter():
    follower = Follower(LIMITS, DT, LIMITS.lower)
    target = LIMITS.upper - 0.05
    positions = np.array([follower.step(target, np.zeros(12))[0] for _ in range(1000)])
    assert (positions <= target + 1e-12).all()
    assert np.ptp(positions[-50:], axis=0).max() < 1e-12
    np.testing.assert_allclose(positions[-1], target, atol=1e-12)


def test_a_smooth_feasible_target_is_met_without_lag():
    times = DT * np.arange(1, 1000)[:, None]
    rate = 0.5 * np.minimum(LIMITS.velocity, LIMITS.acceleration)
    targets, target_velocities = 0.1 * np.sin(rate * times), 0.1 * rate * np.cos(rate * times)
    follower = Follower(LIMITS, DT, np.zeros(12), 0.1 * rate)
    positions = np.array(
        [follower.step(*target)[0] for target in zip(targets, target_velocities, strict=True)]
    )
    assert np.abs(positions - targets).max() < 1e-4


def test_a_late_start_catches_up_with_a_moving_target():
    times = DT * np.arange(1, 400)[:, None]
    targets = np.tile(0.1 * np.sin(times), 12)
    follower = Follower(LIMITS, DT, LIMITS.upper)
    states = zip(targets, np.tile(0.1 * np.cos(times), 12), strict=True)
    positions = np.array([follower.step(*target)[0] for target in states])
    assert np.abs(positions - targets)[-20:].max() < 1e-5


def test_braking_stops_as_fast_as_allowed():
    follower = Follower(LIMITS, DT, MIDDLE, np.minimum(LIMITS.velocity, 0.2))
    ticks = np.ceil(follower.velocity / (LIMITS.acceleration * DT) - 1e-9).astype(int)
    velocities = np.array([follower.brake()[1] for _ in range(20)])
    for joint, last in enumerate(ticks):
        assert velocities[last - 1, joint] == pytest.approx(0, abs=1e-12)
        assert (velocities[: last - 1, joint] > 0).all()


def test_a_joint_that_starts_outside_goes_inside_and_never_further_out():
    follower = Follower(LIMITS, DT, LIMITS.upper + 0.3)
    positions = np.array([follower.step(LIMITS.upper + 1, np.ones(12))[0] for _ in range(1000)])
    assert (np.diff(positions, axis=0) <= 1e-12).all()
    np.testing.assert_allclose(positions[-1], LIMITS.upper, atol=1e-9)


@pytest.mark.parametrize("bad", [np.full(12, np.nan), np.full(12, np.inf), np.zeros(11)])
def test_bad_numbers_are_rejected_and_nothing_moves(bad):
    follower = Follower(LIMITS, DT, MIDDLE)
    for target in ((bad, np.zeros(12)), (np.zeros(12), bad)):
        with pytest.raises(InvalidValueError, match="12 finite numbers"):
            follower.step(*target)
    with pytest.raises(InvalidValueError, match="start position"):
        follower.reset(bad)
    np.testing.assert_array_equal(follower.position, MIDDLE)
