"""The window smoother: the offline Gaussian where the motion is continuous, no jump where it is not."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.frames import WINDOW, KeypointClip
from gesture_bot.base.keypoints import (
    INDEX,
    KEYPOINTS,
    PARENTS,
    bone_lengths,
    bone_vectors,
    from_bone_vectors,
    with_bone_lengths,
)  # fmt: skip
from gesture_bot.refine.smoothing import RADIUS, SIGMA, WindowSmoother

WRIST = INDEX["left_wrist"]


def gesturing(frames: int, seed: int = 0) -> np.ndarray:
    """A body with fixed bones whose directions wander: (frames, 17, 3)."""
    random = np.random.default_rng(seed)
    middle = random.normal(size=(16, 3))
    middle /= np.linalg.norm(middle, axis=1, keepdims=True)
    directions = middle + gaussian_filter1d(random.normal(size=(frames + 48, 16, 3)), 4, axis=0)[24:-24]
    body = np.zeros((frames, len(KEYPOINTS), 3))
    for bone, (child, parent) in enumerate(PARENTS.items()):
        body[:, INDEX[child]] = body[:, INDEX[parent]] + directions[:, bone]
    return with_bone_lengths(body, np.linspace(0.1, 0.3, 16))


def offline(keypoints: np.ndarray) -> np.ndarray:
    smooth = gaussian_filter1d(keypoints, SIGMA, axis=0, mode="nearest", radius=RADIUS)
    return with_bone_lengths(smooth, bone_lengths(keypoints))


def played(clips: list[KeypointClip], smoother: WindowSmoother | None = None) -> np.ndarray:
    """What a listener ends up with, from the first frame on, when each clip replaces what it overlaps."""
    smoother = smoother or WindowSmoother()
    motion = np.empty((0, len(KEYPOINTS), 3))
    for clip in clips:
        smooth = smoother.push(clip)
        assert smooth.stop == clip.stop
        held = np.repeat(motion[-1:], max(0, smooth.start - clips[0].start - len(motion)), axis=0)
        motion = np.concatenate([motion, held])[: smooth.start - clips[0].start]
        motion = np.concatenate([motion, smooth.keypoints])
    return motion


def windows(keypoints: np.ndarray, start: int = 0) -> list[KeypointClip]:
    return [KeypointClip(start + i, keypoints[i : i + WINDOW]) for i in range(0, len(keypoints), WINDOW)]


def steps(motion: np.ndarray) -> np.ndarray:
    return np.linalg.norm(np.diff(motion, axis=0), axis=-1)


def test_one_clip_is_the_offline_gaussian():
    motion = gesturing(40)
    smooth = WindowSmoother().push(KeypointClip(1000, motion))
    assert smooth.start == 1000
    np.testing.assert_allclose(smooth.keypoints, offline(motion), atol=1e-12)


def test_steady_motion_in_windows_is_the_offline_gaussian():
    """A body that moves evenly is where it was heading at each seam: nothing is blended."""
    body = gesturing(1)
    motion = body + np.arange(48)[:, None, None] * np.array([0.01, -0.02, 0.005])
    np.testing.assert_allclose(played(windows(motion)), offline(motion), atol=1e-12)


def test_continuous_motion_in_windows_stays_near_the_offline_gaussian():
    motion = gesturing(160)
    error = np.linalg.norm(played(windows(motion)) - offline(motion), axis=-1)
    assert steps(motion).max() > 0.1
    assert error.max() < 0.015
    assert error.mean() < 0.002


def test_unrelated_windows_move_no_more_abruptly_than_the_recording():
    takes = gesturing(4000, seed=2)
    chosen = np.random.default_rng(1).integers(0, len(takes) - WINDOW, 40)
    raw = np.concatenate([takes[i : i + WINDOW] for i in chosen])
    smooth = played(windows(raw))
    assert steps(raw).max() > 0.6
    assert steps(smooth).max() < steps(takes).max()
    assert np.abs(np.diff(smooth, 2, axis=0)).max() < np.abs(np.diff(takes, 2, axis=0)).max()


def test_the_arms_of_a_new_window_are_reached_by_its_end():
    here, there = gesturing(1, seed=3), gesturing(1, seed=4)
    vectors = bone_vectors(there)
    vectors[:, :8] = bone_vectors(here)[:, :8]  # the same trunk
    vectors[:, 11] = bone_vectors(here)[:, 11]  # and right shoulder
    there = from_bone_vectors(vectors)
    motion = played(windows(np.repeat(np.concatenate([here, there]), 2 * WINDOW, axis=0)))
    assert steps(np.concatenate([here, there])).max() > 0.1
    assert np.linalg.norm(motion[-1] - there[0], axis=-1).max() < 0.01


def test_trunk_and_head_do_not_follow_each_window():
    """Windows of two recordings, one more bent than the other, take turns."""
    here = gesturing(1, seed=3)
    there = here.copy()
    there[:, 1:] += [0.03, 0.0, 0.0]
    motion = played(windows(np.repeat(np.concatenate([here, there] * 10), WINDOW, axis=0)))
    head = motion[80:, INDEX["head"], 0]
    assert np.ptp(head) < 0.6 * 0.03
    assert np.abs(np.diff(head)).max() < 0.15 * 0.03
    stays = played(windows(np.repeat(np.concatenate([here, there]), 5 * WINDOW, axis=0)))
    assert np.linalg.norm(stays[-1] - there[0], axis=-1).max() < 0.001


def test_bones_keep_their_lengths():
    takes = [gesturing(WINDOW, seed=i) for i in range(10)]
    raw = np.concatenate(takes)
    np.testing.assert_allclose(bone_lengths(played(windows(raw))), bone_lengths(raw), atol=1e-9)


def test_bones_of_another_body_are_reached_gradually():
    small = gesturing(2 * WINDOW)
    lengths = bone_lengths(played(windows(np.concatenate([small, 1.2 * small]))))
    np.testing.assert_allclose(lengths[:8], bone_lengths(small)[:8])
    np.testing.assert_allclose(lengths[-8:], 1.2 * bone_lengths(small)[-8:])
    assert np.abs(np.diff(lengths, axis=0)).max() < 0.3 * 0.2 * lengths.max()


def test_a_clip_cuts_what_was_planned_after_its_start():
    take = gesturing(90, seed=5)
    old, new = take[:24], take[70:86]
    motion = played([KeypointClip(50, old), KeypointClip(60, new)])
    assert len(motion) == 26
    undisturbed = played([KeypointClip(50, old)])
    np.testing.assert_array_equal(motion[: 10 - RADIUS], undisturbed[: 10 - RADIUS])
    assert steps(np.concatenate([old[:10], new])).max() > 0.3
    assert steps(motion).max() < 0.15


def test_cutting_with_the_same_plan_changes_nothing():
    motion = gesturing(1) + np.arange(32)[:, None, None] * np.array([0.0, 0.01, 0.02])
    clips = [KeypointClip(0, motion[:24]), KeypointClip(12, motion[12:])]
    np.testing.assert_allclose(played(clips), offline(motion), atol=1e-12)


def test_a_gap_is_held():
    before, after = gesturing(16, seed=7), gesturing(16, seed=8)
    smoother = WindowSmoother()
    smoother.push(KeypointClip(0, before))
    smooth = smoother.push(KeypointClip(100_000, after))
    assert (smooth.start, smooth.stop) == (100_000 - RADIUS, 100_016)
    assert np.linalg.norm(smooth.keypoints[0] - before[-1], axis=-1).max() < 1e-3
    assert steps(smooth.keypoints).max() < 0.5 * steps(np.stack([before[-1], after[0]])).max()


def test_a_short_gap_is_what_the_provisional_tail_promised():
    before = gesturing(16, seed=7)
    smoother = WindowSmoother()
    tail = smoother.push(KeypointClip(0, before)).keypoints
    smooth = smoother.push(KeypointClip(19, np.repeat(before[-1:], 8, axis=0)))
    np.testing.assert_allclose(smooth.keypoints[0], tail[15], atol=0.01)


def test_only_the_last_frames_of_a_clip_come_again():
    smoother = WindowSmoother()
    emitted = [smoother.push(KeypointClip(8 * i, gesturing(WINDOW, seed=i))) for i in range(6)]
    for earlier, later in pairwise(emitted):
        assert later.start == earlier.stop - RADIUS


def test_a_clip_pushed_again_is_emitted_again():
    clips = [KeypointClip(8 * i, gesturing(WINDOW, seed=i)) for i in range(6)]
    smoother = WindowSmoother()
    first = [smoother.push(clip) for clip in clips][-2]
    again = smoother.push(clips[-2])
    np.testing.assert_array_equal(again.keypoints, first.keypoints)


def test_a_single_frame_is_a_clip():
    motion = np.repeat(gesturing(1), 12, axis=0)
    clips = [KeypointClip(i, motion[i : i + 1]) for i in range(12)]
    np.testing.assert_allclose(played(clips), motion, atol=1e-12)


@pytest.mark.parametrize("bad", [np.zeros((0, 17, 3)), np.zeros((8, 13, 3)), np.zeros(17)])
def test_a_bad_shape_is_refused(bad):
    with pytest.raises(InvalidValueError, match="n, 17, 3"):
        WindowSmoother().push(KeypointClip(0, bad))


def test_nan_is_refused_and_the_motion_stands():
    good = [KeypointClip(WINDOW * i, gesturing(WINDOW, seed=i)) for i in range(3)]
    expected = played(good)
    smoother = WindowSmoother()
    bad = gesturing(WINDOW)
    bad[3, WRIST, 1] = np.nan
    first = played(good[:2], smoother)
    with pytest.raises(InvalidValueError, match="frame 19 .*left_wrist"):
        smoother.push(KeypointClip(16, bad))
    last = smoother.push(good[2])
    np.testing.assert_array_equal(np.concatenate([first[: last.start], last.keypoints]), expected)
