"""The motion mux: who owns a joint, and how it passes from one owner to the next."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from gesture_bot.base.errors import FileFormatError, InvalidValueError
from gesture_bot.base.files import config_dir
from gesture_bot.base.trajectory import JointTrajectory
from gesture_bot.retarget.follower import JointLimits
from gesture_bot.retarget.robot import load_robot
from gesture_bot.servo.arbitration import Lock, Source, load_arbitration
from gesture_bot.servo.envelope import Envelope
from gesture_bot.servo.mux import MotionMux

JOINTS = ("left", "right", "head")
REST = np.array([0.1, -0.1, 0.0])
SOURCES, LOCKS = load_arbitration()
LIMITS = JointLimits(JOINTS, np.full(3, -2.0), np.full(3, 2.0), np.full(3, 30.0), np.full(3, 90.0))
T0 = 1.7e9
DT = 0.02


def wave(joints=JOINTS, start=T0, seconds=4.0, amplitude=0.5, rate=1.0):
    """A sine about the rest pose, at rest at neither end."""
    times = start + np.arange(0, seconds + 1e-9, 0.02)
    phase = 2 * np.pi * rate * (times - start)[:, None]
    base = np.array([REST[JOINTS.index(joint)] for joint in joints])
    speeds = np.tile(2 * np.pi * rate * amplitude * np.cos(phase), len(joints))
    return JointTrajectory(joints, times, base + amplitude * np.sin(phase), speeds)


def pose(joint, angle, start):
    return JointTrajectory((joint,), np.array([start]), np.array([[angle]]), np.zeros((1, 1)))


def play(mux, start, seconds, events=()):
    """Tick every 20 ms; `events` are (time, call). Returns time, position, velocity of first points."""
    events = sorted(events, key=lambda event: event[0])
    out = []
    for now in start + DT * np.arange(round(seconds / DT)):
        while events and events[0][0] <= now + 1e-6:
            events.pop(0)[1]()
        trajectory = mux.tick(now)
        assert trajectory.joints == JOINTS
        assert trajectory.times[0] == now and trajectory.times[-1] > now + 0.3
        out.append((now, trajectory.positions[0], trajectory.velocities[0]))
    return tuple(map(np.array, zip(*out, strict=True)))


def assert_smooth(positions, velocities):
    """No step: the positions move as the velocities say, and the velocities change by an acceleration."""
    moved = np.diff(positions, axis=0)
    mean = 0.5 * (velocities[1:] + velocities[:-1]) * DT
    assert np.abs(moved - mean).max() < 2e-3
    assert np.abs(np.diff(velocities, axis=0)).max() < 60 * DT


def test_it_begins_at_rest_owned_by_nobody():
    mux = MotionMux(LIMITS, REST, SOURCES, LOCKS)
    trajectory = mux.tick(T0)
    np.testing.assert_array_equal(trajectory.positions, np.tile(REST, (8, 1)))
    assert set(mux.owners.values()) == {"nobody"}


def test_a_gesture_is_taken_up_smoothly_then_followed_and_its_last_point_held():
    mux = MotionMux(LIMITS, REST, SOURCES, LOCKS)
    gesture = wave(seconds=2.0)
    mux.set_source("gesture", gesture, T0)
    times, positions, velocities = play(mux, T0, 4.0)
    assert_smooth(positions, velocities)
    followed = (times > T0 + 0.6) & (times < T0 + 2.0)
    np.testing.assert_allclose(positions[followed], gesture.at(times[followed])[0], atol=1e-6)
    assert set(mux.owners.values()) == {"gesture"}
    np.testing.assert_allclose(velocities[-1], 0, atol=1e-6)


def test_a_new_gesture_replaces_the_old_from_its_first_point_on():
    mux = MotionMux(LIMITS, REST, SOURCES, LOCKS)
    old, new = wave(), wave(start=T0 + 2.0, amplitude=0.25, rate=2.0)  # as fast at its start, then different
    mux.set_source("gesture", old, T0)
    play(mux, T0, 1.0)
    mux.set_source("gesture", new, T0 + 1.0)
    times, positions, _ = play(mux, T0 + 1.0, 2.0)
    early = times < T0 + 2.0
    np.testing.assert_allclose(positions[early], old.at(times[early])[0], atol=1e-6)
    np.testing.assert_allclose(positions[~early], new.at(times[~early])[0], atol=1e-6)


@pytest.mark.parametrize("offset", np.linspace(0.0, 0.98, 8))
def test_teleop_takes_one_arm_and_gives_it_back_without_a_step(offset):
    mux = MotionMux(LIMITS, REST, SOURCES, LOCKS)
    gesture = wave(seconds=8.0)
    mux.set_source("gesture", gesture, T0)
    play(mux, T0, 1.0)
    take = T0 + 1.0 + offset
    owners = []
    events = [
        (take, lambda: mux.set_source("teleop", wave(("left",), take, 1.0, 0.8, 0.7), take)),
        (take + 0.5, lambda: owners.append(mux.owners)),
        (take + 0.9, lambda: owners.append(mux.owners)),
        (take + 1.1, lambda: owners.append(mux.owners)),
    ]
    times, positions, velocities = play(mux, T0 + 1.0, 5.0, events)
    assert_smooth(positions, velocities)
    assert [owner["left"] for owner in owners] == ["teleop", "teleop", "gesture"]
    assert {owner["right"] for owner in owners} == {"gesture"}
    expected = gesture.at(times)[0]
    np.testing.assert_allclose(positions[:, 1:], expected[:, 1:], atol=1e-6)
    given_back = times > take + 1.0 + 0.65
    np.testing.assert_allclose(positions[given_back], expected[given_back], atol=1e-6)
    during = (times > take + 0.65) & (times < take + 1.0)
    assert np.abs(positions[during, 0] - expected[during, 0]).max() > 0.2


def test_teleop_keeps_a_joint_while_its_messages_come():
    mux = MotionMux(LIMITS, REST, SOURCES, LOCKS)
    for k in range(20):
        mux.set_source("teleop", pose("head", 0.3, T0 + 0.2 * k), T0 + 0.2 * k)
        _, positions, velocities = play(mux, T0 + 0.2 * k, 0.2)
        assert mux.owners == {"left": "nobody", "right": "nobody", "head": "teleop"}
    assert positions[-1] == pytest.approx([*REST[:2], 0.3])
    play(mux, T0 + 4.0, 0.5)
    assert mux.owners["head"] == "nobody"
    _, positions, _ = play(mux, T0 + 4.5, 0.5)
    assert positions[-1, 2] == pytest.approx(0.3), "nobody owns it: it stays"


def test_teleop_that_comes_back_does_not_begin_where_it_once_ended():
    mux = MotionMux(LIMITS, REST, SOURCES, LOCKS)
    mux.set_source("teleop", pose("left", 0.8, T0), T0)
    play(mux, T0, 2.0)
    mux.set_source("gesture", pose("left", -0.5, T0 + 2.0), T0 + 2.0)
    play(mux, T0 + 2.0, 1.0)
    mux.set_source("teleop", pose("left", -0.6, T0 + 3.2), T0 + 3.0)
    _, positions, velocities = play(mux, T0 + 3.0, 1.0)
    assert_smooth(positions, velocities)
    assert positions[:, 0].max() <= -0.5 + 1e-9
    assert positions[:, 0].min() == pytest.approx(-0.6, abs=0.02)


def name_targets(mux, targets, start):
    """An operator names a target for the head ten times a second, 0.3 s ahead. Returns as `play` does."""
    out = []
    for k, angle in enumerate(targets):
        now = start + 0.1 * k
        mux.set_source("teleop", pose("head", angle, now + 0.3), now)
        out.append(play(mux, now, 0.1))
    return tuple(np.concatenate(part) for part in zip(*out, strict=True))


def test_a_target_named_again_and_again_is_approached_smoothly():
    mux = MotionMux(LIMITS, REST, SOURCES, LOCKS)
    _, positions, velocities = name_targets(mux, [0.0] * 10 + [1.0] * 25, T0)
    assert_smooth(positions, velocities)
    assert np.abs(velocities[:, 2]).max() == pytest.approx(1.7, abs=0.1)
    assert (np.diff(positions[:, 2]) >= -1e-9).all(), "it never turns back"
    assert positions[-1, 2] == pytest.approx(1.0, abs=0.01)


def test_targets_that_move_are_followed_evenly():
    mux = MotionMux(LIMITS, REST, SOURCES, LOCKS)
    _, positions, velocities = name_targets(mux, 0.05 * np.arange(40), T0)
    assert_smooth(positions, velocities)
    np.testing.assert_allclose(velocities[100:, 2], 0.5, atol=0.12)


@pytest.mark.parametrize("late", [0.0, 0.06, 0.3])
def test_a_jump_between_gestures_is_joined_smoothly(late):
    """Also when the new one is heard only after it has begun."""
    mux = MotionMux(LIMITS, REST, SOURCES, LOCKS)
    old, new = wave(), wave(start=T0 + 1.1, amplitude=-0.5, rate=0.5)
    mux.set_source("gesture", old, T0)
    _, *before = play(mux, T0, 1.1 + late)
    mux.set_source("gesture", new, T0 + 1.1 + late)
    times, *after = play(mux, T0 + 1.1 + late, 2.5)
    assert_smooth(*(np.vstack(parts) for parts in zip(before, after, strict=True)))
    np.testing.assert_allclose(after[0][-10:], new.at(times[-10:])[0], atol=1e-2)


def test_a_lock_masks_gestures_but_not_teleop():
    mux = MotionMux(LIMITS, REST, SOURCES, LOCKS)
    mux.set_source("gesture", wave(seconds=10.0), T0)
    play(mux, T0, 1.1)
    mux.set_lock("teleop", True, T0)
    _, positions, velocities = play(mux, T0 + 1.1, 1.0)
    assert_smooth(positions, velocities)
    assert np.ptp(positions[-20:], axis=0).max() < 1e-2
    assert set(mux.owners.values()) == {"nobody"}
    mux.set_source("teleop", pose("head", 0.4, T0 + 2.1), T0 + 2.1)
    play(mux, T0 + 2.1, 0.3)
    assert mux.owners == {"left": "nobody", "right": "nobody", "head": "teleop"}
    mux.set_lock("teleop", False, T0)
    _, positions, velocities = play(mux, T0 + 2.4, 1.5)
    assert_smooth(positions, velocities)
    assert set(mux.owners.values()) == {"gesture"}


def test_stop_brakes_and_latches_until_reset():
    mux = MotionMux(replace(LIMITS, acceleration=np.full(3, 44.0)), REST, SOURCES, LOCKS)
    mux.set_source("gesture", wave(seconds=10.0), T0)
    _, positions, velocities = play(mux, T0, 1.0)
    mux.stop()
    _, braking, slowing = play(mux, T0 + 1.0, 1.0)
    assert_smooth(np.vstack([positions, braking]), np.vstack([velocities, slowing]))
    assert np.abs(slowing[5]).max() < 0.4 * np.abs(slowing[0]).max(), "within 0.1 s"
    mux.set_source("teleop", wave(start=T0 + 2.0), T0 + 2.0)
    mux.set_source("gesture", wave(start=T0 + 2.0), T0 + 2.0)
    _, positions, _ = play(mux, T0 + 2.0, 1.0)
    assert np.ptp(positions, axis=0).max() < 1e-3
    assert mux.stopped and set(mux.owners.values()) == {"stop"}
    mux.reset()
    _, positions, _ = play(mux, T0 + 3.0, 0.5)
    assert np.ptp(positions, axis=0).max() < 1e-3, "what was asked for before the reset is void"
    assert set(mux.owners.values()) == {"nobody"}
    mux.set_source("teleop", wave(start=T0 + 3.5), T0 + 3.5)
    _, positions, velocities = play(mux, T0 + 3.5, 1.0)
    assert_smooth(positions, velocities)
    assert set(mux.owners.values()) == {"teleop"}


def test_a_clock_that_is_set_back_voids_the_plans_and_new_ones_are_followed():
    mux = MotionMux(LIMITS, REST, SOURCES, LOCKS)
    mux.set_source("gesture", wave(seconds=10.0), T0)
    _, *before = play(mux, T0, 1.1)
    earlier = T0 - 3600.0
    _, *after = play(mux, earlier, 1.0)
    assert after[0][0] == pytest.approx(before[0][-1]) and after[1][0] == pytest.approx(before[1][-1])
    assert_smooth(*after)
    assert set(mux.owners.values()) == {"nobody"}
    again = wave(start=earlier + 1.0)
    mux.set_source("gesture", again, earlier + 1.0)
    times, positions, _ = play(mux, earlier + 1.0, 2.0)
    np.testing.assert_allclose(positions[-10:], again.at(times[-10:])[0], atol=1e-6)


def test_bad_messages_are_refused_and_change_nothing():
    mux = MotionMux(LIMITS, REST, SOURCES, LOCKS)
    with pytest.raises(InvalidValueError, match="'tail'; valid: left, right, head"):
        mux.set_source("teleop", pose("tail", 0.0, T0), T0)
    with pytest.raises(InvalidValueError, match="positions must be finite numbers: nan"):
        mux.set_source("teleop", pose("left", np.nan, T0), T0)
    with pytest.raises(InvalidValueError, match="'ghost'; valid: gesture, teleop"):
        mux.set_source("ghost", pose("left", 0.0, T0), T0)
    mux.tick(T0)
    assert set(mux.owners.values()) == {"nobody"}


def test_a_lock_masks_the_sources_of_its_priority_and_below_and_a_dead_publisher_locks():
    sources = (Source("gesture", 10), Source("show", 50), Source("teleop", 100))
    lock = Lock("guard", 50, timeout=0.3)
    mux = MotionMux(LIMITS, REST, sources, [lock])
    for source in sources:
        mux.set_source(source.name, wave((JOINTS[sources.index(source)],), T0), T0)

    def owners(now):
        mux.tick(now)
        return list(mux.owners.values())

    assert owners(T0) == ["nobody", "nobody", "teleop"], "nobody has released it yet"
    mux.set_lock("guard", False, T0 + 0.1)
    assert owners(T0 + 0.2) == ["gesture", "show", "teleop"]
    assert mux.locks(T0 + 0.2) == []
    assert owners(T0 + 0.5) == ["nobody", "nobody", "teleop"]
    assert mux.locks(T0 + 0.5) == [lock]
    mux.set_lock("guard", False, T0 + 0.6)
    assert owners(T0 + 0.7) == ["gesture", "show", "teleop"]
    with pytest.raises(InvalidValueError, match=r"gard.*guard"):
        mux.set_lock("gard", True, T0)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("priority: 100", "priority: 300"), "line 11: sources.teleop.priority.*255"),
        (("timeout: 0.5", "timeout: -1"), "timeout.*greater than 0"),
        (("priority: 100", "priority: 10"), "same priority"),
        (("topic: teleop/lock", "topic: teleop/joint_trajectory"), "twice"),
        (("  teleop:\n    topic: teleop/j", "  stop:\n    topic: teleop/j"), "'stop' is no name"),
        (("timeout: 0.5", "time: 0.5"), "line 12: sources.teleop.time"),
    ],
)
def test_a_mistake_in_the_file_is_named(tmp_path, change, words):
    text = (config_dir() / "motion_mux.yaml").read_text()
    assert change[0] in text
    (tmp_path / "mux.yaml").write_text(text.replace(*change, 1))
    with pytest.raises(FileFormatError, match=words):
        load_arbitration(str(tmp_path / "mux.yaml"))


def swing(rng, limits, start, seconds):
    """All joints at random about the middle of their range, inside half of what they may do."""
    times = start + np.arange(0, seconds, 0.02)
    rate = 2 * np.pi * rng.uniform(0.2, 0.8, len(limits.joints))
    amplitude = np.minimum(0.45 * (limits.upper - limits.lower), 0.5 * limits.velocity / rate)
    amplitude = np.minimum(amplitude, 0.4 * limits.acceleration / rate**2)
    phase = rate * (times - start)[:, None] + rng.uniform(0, 2 * np.pi, len(limits.joints))
    middle = (limits.lower + limits.upper) / 2
    positions, velocities = middle + amplitude * np.sin(phase), amplitude * rate * np.cos(phase)
    return JointTrajectory(limits.joints, times, positions, velocities)


def test_a_thousand_hand_overs_stay_inside_the_limits_and_close_to_what_is_asked():
    robot = load_robot("toa")
    rng = np.random.default_rng(0)
    limits, steps = robot.limits, np.arange(0.0, 0.08, 0.01)
    mux, envelope = MotionMux(limits, robot.rest, SOURCES), Envelope(limits, 0.01, robot.rest)
    sent, off, owners = [robot.rest], [], []
    now = T0
    mux.set_source("gesture", swing(rng, limits, now, 1500.0), now)
    for _ in range(500):  # each takes and gives back
        take = now + rng.uniform(0.2, 0.6)
        teleop = swing(rng, limits, take, rng.uniform(0.2, 0.5))
        end = teleop.times[-1] + 0.8
        while now < end:
            if teleop is not None and now >= take:
                mux.set_source("teleop", teleop, now)
                teleop = None
            asked, speeds = mux.tick(now).at(now + steps)
            sent += [envelope.step(*target) for target in zip(asked, speeds, strict=True)]
            off.append(np.abs(sent[-1] - asked[-1]).max())
            owners.append(mux.owners["head_pan"])
            now += 0.08
    assert sum(one != other for one, other in pairwise(owners)) >= 999
    velocity = np.diff(sent, axis=0) / 0.01
    assert (np.abs(np.diff(velocity, axis=0)) <= limits.acceleration * 0.01 + 1e-9).all()
    assert (np.abs(velocity) <= limits.velocity + 1e-9).all()
    assert np.quantile(off[100:], 0.99) < 0.01 and max(off[100:]) < 0.1
