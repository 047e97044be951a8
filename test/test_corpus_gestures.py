"""The composed motion: a body that a person could have, gestures that land on words, emotions that differ."""

import numpy as np
import pytest

from gesture_bot.base.frames import FRAME_RATE
from gesture_bot.base.keypoints import INDEX, bone_lengths
from gesture_bot.corpus.body import FOREARM, TRUNK, UPPER_ARM
from gesture_bot.corpus.forms import FORMS
from gesture_bot.corpus.gestures import plan_gestures
from gesture_bot.corpus.movement import Submovement, path
from gesture_bot.corpus.styles import STYLES, varied
from gesture_bot.corpus.synthesis import gesture

WRISTS = [INDEX["left_wrist"], INDEX["right_wrist"]]
TAKES = 8


def stressed_words(generator: np.random.Generator) -> list[list[float]]:
    """Five sentences of stressed syllables 0.3 to 0.8 s apart, with pauses of a second."""
    sentences, now = [], 0.5
    for _ in range(5):
        sentences.append((now + np.cumsum(generator.uniform(0.3, 0.8, generator.integers(4, 9)))).tolist())
        now = sentences[-1][-1] + 1.0
    return sentences


def takes(emotion: str) -> list[np.ndarray]:
    """Keypoints of one recording in each of several variants of an emotion."""
    motions = []
    for number, style in enumerate(varied(emotion, TAKES, seed=0)):
        generator = np.random.default_rng(number)
        sentences = stressed_words(generator)
        frames = round((sentences[-1][-1] + 3.0) * FRAME_RATE)
        motions.append(gesture(sentences, frames, style, generator))
    return motions


@pytest.fixture(scope="module")
def motions() -> dict[str, list[np.ndarray]]:
    return {emotion: takes(emotion) for emotion in STYLES}


def speeds(keypoints: np.ndarray) -> np.ndarray:
    return np.linalg.norm(np.diff(keypoints[:, WRISTS], axis=0), axis=-1) * FRAME_RATE


@pytest.mark.parametrize("emotion", STYLES)
def test_bones_keep_their_length(motions, emotion):
    lengths = bone_lengths(np.concatenate(motions[emotion]))
    np.testing.assert_allclose(lengths, np.broadcast_to(lengths[0], lengths.shape), atol=1e-9)
    elbow, wrist = list(INDEX).index("left_elbow") - 1, list(INDEX).index("left_wrist") - 1
    np.testing.assert_allclose(lengths[0, [elbow, wrist]], [UPPER_ARM, FOREARM])


@pytest.mark.parametrize("emotion", STYLES)
def test_a_person_could_move_so(motions, emotion):
    for keypoints in motions[emotion]:
        assert np.isfinite(keypoints).all()
        assert speeds(keypoints).max() < 2.5
        acceleration = np.linalg.norm(np.diff(keypoints[:, WRISTS], 2, axis=0), axis=-1) * FRAME_RATE**2
        assert acceleration.max() < 50
        assert np.linalg.norm(keypoints[:, WRISTS[0]] - keypoints[:, WRISTS[1]], axis=-1).min() > 0.07


@pytest.mark.parametrize("emotion", STYLES)
def test_wrists_stay_out_of_the_trunk(motions, emotion):
    keypoints = np.concatenate(motions[emotion])
    wrists, spine, neck = (keypoints[:, index] for index in (WRISTS, [INDEX["spine"]], [INDEX["neck"]]))
    share = (wrists - spine)[..., 2:] / (neck - spine)[..., 2:]
    from_axis = wrists - (spine + share * (neck - spine))
    assert np.linalg.norm(from_axis[share[..., 0] < 0.9][:, :2] / TRUNK, axis=-1).min() > 0.95


@pytest.mark.parametrize("emotion", STYLES)
def test_strokes_end_on_stressed_syllables(emotion):
    """The hands are fast in the half second before the stress, and nearly still one frame after it."""
    found = 0
    for number, style in enumerate(varied(emotion, TAKES, seed=0)):
        sentences = stressed_words(np.random.default_rng(number))
        frames = round((sentences[-1][-1] + 3.0) * FRAME_RATE)
        strokes = plan_gestures(sentences, frames / FRAME_RATE, style, np.random.default_rng(1)).strokes
        keypoints = gesture(sentences, frames, style, np.random.default_rng(1))
        assert set(strokes) <= set(np.concatenate(sentences))
        speed = speeds(keypoints).max(axis=1)
        for stroke in strokes:
            last = int(stroke * FRAME_RATE)
            assert speed[last + 1] < 0.4 * speed[last - 8 : last + 1].max()
        found += len(strokes)
    assert found >= TAKES * 3


def test_emotions_differ_by_clear_margins(motions):
    speed = {emotion: np.mean([speeds(take).mean() for take in motions[emotion]]) for emotion in STYLES}
    height = {
        emotion: np.mean([take[:, WRISTS, 2].mean() for take in motions[emotion]]) for emotion in STYLES
    }
    assert min(speed["angry"], speed["excited"]) > 2.5 * speed["sad"]
    assert speed["neutral"] > 1.5 * max(speed["sad"], speed["bored"])
    assert height["happy"] > height["neutral"] + 0.05
    assert height["neutral"] > height["sad"] + 0.05


@pytest.mark.parametrize("emotion", STYLES)
def test_every_emotion_leaves_the_controls_a_choice(motions, emotion):
    wrists = np.concatenate(motions[emotion])[:, WRISTS]
    speed = np.concatenate([speeds(take) for take in motions[emotion]])
    asymmetry = np.abs(wrists[:, 0, 2] - wrists[:, 1, 2])
    radius = np.linalg.norm(wrists[..., :2], axis=-1)
    low, high = np.percentile(wrists[..., 2], [10, 90])
    assert high - low > 0.12
    slow, fast = np.percentile(speed, [30, 95])
    assert slow < 0.03 and fast > 0.2
    even, uneven = np.percentile(asymmetry, [15, 90])
    assert even < 0.03 and uneven > 0.06
    narrow, wide = np.percentile(radius, [10, 90])
    assert wide - narrow > 0.1


def test_two_handed_and_one_handed_units_of_either_hand_occur():
    used = set()
    for number, style in enumerate(varied("neutral", 20, seed=0)):
        plan = plan_gestures([[1.5]], 4.0, style, np.random.default_rng(number))
        used.add((bool(plan.left), bool(plan.right)))
    assert used == {(True, False), (False, True), (True, True)}


def test_nothing_said_is_idle_motion():
    still = gesture([], 150, STYLES["neutral"], np.random.default_rng(0))
    assert 0 < speeds(still).max() < 0.15


def test_the_same_seed_moves_the_same_way():
    first, second = takes("excited"), takes("excited")
    assert all(np.array_equal(a, b) for a, b in zip(first, second, strict=True))


def test_overlapping_submovements_reach_the_last_goal_smoothly():
    times = np.linspace(0, 3, 3001)
    movements = [
        Submovement(0.5, 1.5, np.array([1.0, 0.0]), bow=np.array([0.0, 0.3])),
        Submovement(1.2, 2.5, np.array([0.0, 2.0]), curl=np.array([0.2, 0.0])),
    ]
    states = path(times, np.zeros(2), movements)
    np.testing.assert_allclose(states[times <= 0.5], 0)
    np.testing.assert_allclose(states[times >= 2.5], [[0, 2]] * 501, atol=1e-12)
    assert np.abs(np.diff(states, 3, axis=0)).max() / 0.001**3 < 1000


def test_styles_name_forms_that_exist():
    assert {name for style in STYLES.values() for name in style.forms} <= set(FORMS)
