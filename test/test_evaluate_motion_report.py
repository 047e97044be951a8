"""The motion report, on motions whose faults and strokes are known."""

import numpy as np
import pytest

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.evaluate.motion_report import TICK, latency_ms, motion_report, stroke_time
from gesture_bot.retarget.follower import JointLimits

EPOCH = 1.7e9
LIMITS = JointLimits(
    ("pan", "tilt"),
    np.array([-1.0, -0.5]),
    np.array([1.0, 0.5]),
    np.array([2.0, 3.0]),
    np.array([20.0, 20.0]),
)
TIMES = EPOCH + np.arange(0, 10, 0.02)


def swinging() -> np.ndarray:
    """Pan swings to its limits at its velocity limit, tilt rests."""
    pan = np.sin(2 * (TIMES - EPOCH))
    return np.stack([pan, np.zeros_like(pan)], axis=1)


def test_a_motion_at_its_limits_is_clean():
    rounded = np.round(swinging() / TICK) * TICK
    report = motion_report(LIMITS.joints, TIMES, rounded, LIMITS)
    assert (report.limit_violations, report.joint_jumps) == (0, 0)
    assert report.max_velocity_rad_s == pytest.approx(2.0, abs=2 * TICK / 0.04)
    assert report.mean_rate_hz == pytest.approx(50, abs=1e-3)
    assert report.longest_gap_s == pytest.approx(0.02, abs=1e-6)


def test_samples_outside_the_limits_are_counted():
    positions = swinging()
    positions[100:103, 1] = -0.5 - 2 * TICK
    assert motion_report(LIMITS.joints, TIMES, positions, LIMITS).limit_violations == 3


def test_jumps_are_counted_there_and_back():
    positions = swinging()
    positions[100:, 1] += 3.0 * 0.024 + 3 * TICK
    positions[200:, 1] = 0.0
    assert motion_report(LIMITS.joints, TIMES, positions, LIMITS).joint_jumps == 2


def test_stamps_that_are_off_by_two_milliseconds_make_no_jump():
    off = np.random.default_rng(0).uniform(-2e-3, 2e-3, len(TIMES))
    rounded = np.round(swinging() / TICK) * TICK
    assert motion_report(LIMITS.joints, TIMES + off, rounded, LIMITS).joint_jumps == 0


def test_a_long_gap_allows_a_long_way():
    kept = np.r_[0:100, 150:500]
    report = motion_report(LIMITS.joints, TIMES[kept], swinging()[kept], LIMITS)
    assert report.joint_jumps == 0
    assert report.longest_gap_s == pytest.approx(1.02)


def test_one_tick_between_close_samples_is_no_dash():
    times = EPOCH + np.array([0.0, 0.001, 0.02, 0.021, 0.04, 0.041])
    positions = TICK * np.array([[0, 0], [1, 0], [0, 0], [1, 0], [0, 0], [1, 0]])
    assert motion_report(LIMITS.joints, times, positions, LIMITS).max_velocity_rad_s <= TICK / 0.04


def test_joints_may_come_in_another_order():
    report = motion_report(("tilt", "pan"), TIMES, swinging()[:, ::-1], LIMITS)
    assert report == motion_report(LIMITS.joints, TIMES, swinging(), LIMITS)


@pytest.mark.parametrize(
    ("joints", "times", "positions", "message"),
    [
        (("pan", "roll"), TIMES, swinging(), "'roll'; valid: pan, tilt"),
        (LIMITS.joints, TIMES[:1], swinging()[:1], "two samples"),
        (LIMITS.joints, TIMES[::-1], swinging(), "increasing"),
        (LIMITS.joints, TIMES, np.full_like(swinging(), np.nan), "finite"),
    ],
)
def test_what_is_no_motion_is_refused(joints, times, positions, message):
    with pytest.raises(InvalidValueError, match=message):
        motion_report(joints, times, positions, LIMITS)


def test_latency_is_the_median_and_the_99th_percentile():
    latency = latency_ms(np.arange(101) / 1000)
    assert (latency.median, latency.p99) == pytest.approx((50, 99))
    assert latency_ms([]) is None


def minimum_jerk(times: np.ndarray, end: float, duration: float) -> np.ndarray:
    s = np.clip((times - end) / duration + 1, 0, 1)
    return 10 * s**3 - 15 * s**4 + 6 * s**5


def gesture(times: np.ndarray, end: float, duration: float, hold: float) -> np.ndarray:
    """A wrist that is raised, beats down until `end`, is held, goes back; idle sway and noise on top."""
    raised = 0.15 * minimum_jerk(times, end - duration - 0.05, 0.45)
    stroke = 0.2 * minimum_jerk(times, end, duration)
    back = 0.05 * minimum_jerk(times, end + hold + 0.6, 0.6)
    sway = 0.01 * np.sin(2 * (times - EPOCH))
    noise = 5e-4 * np.random.default_rng(0).normal(size=(len(times), 3))
    return (
        np.stack([0.5 * (raised - stroke), 0.3 * stroke - back, raised - stroke + back], axis=1)
        + sway[:, None]
        + noise
    )


@pytest.mark.parametrize("rate", [15, 50, 100])
@pytest.mark.parametrize("duration", [0.25, 0.4, 0.6])
@pytest.mark.parametrize("hold", [0.0, 0.4])
def test_a_stroke_is_found_where_it_ends(rate, duration, hold):
    times = EPOCH + np.arange(0, 6, 1 / rate)
    for end in EPOCH + 3 + np.linspace(0, 1 / rate, 5):
        wrist = gesture(times, end, duration, hold)
        for near in (end - 0.1, end, end + 0.15):
            assert stroke_time(times, wrist, near) == pytest.approx(end, abs=0.05)


def test_a_resting_wrist_has_no_stroke():
    assert stroke_time(TIMES, np.zeros((len(TIMES), 3)), EPOCH + 5) is None


def test_a_stroke_out_of_reach_does_not_count():
    wrist = gesture(TIMES, EPOCH + 3, 0.4, 0.4)
    assert stroke_time(TIMES, wrist, EPOCH + 8) is None
    assert stroke_time(TIMES, wrist, EPOCH + 3.4, within=0.1) is None
    assert stroke_time(TIMES, wrist, EPOCH + 60) is None
