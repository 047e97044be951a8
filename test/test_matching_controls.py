"""Controls: what they measure, what they mask, and how they give way."""

import dataclasses

import numpy as np
import pytest
from small_database import motion, small_database, sound

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.keypoints import INDEX, mirror
from gesture_bot.corpus.recordings import Recording, build_database
from gesture_bot.matching.controls import FEWEST, ROOM, Constraint, Controls, LabelConstraint
from gesture_bot.matching.quantities import MEASURES, QUANTITIES, TWO_HANDED, measure
from gesture_bot.matching.search import eligible

DATABASE = small_database()
CONTROLS = Controls(DATABASE)
ROWS = DATABASE.starts[:, None] + np.arange(64)
MEASURED = {quantity: np.moveaxis(values[:, ROWS], 0, -1) for quantity, values in measure(DATABASE).items()}

HANDS = [(quantity, "both") for quantity in QUANTITIES]
HANDS += [(q, hand) for q in QUANTITIES if q not in TWO_HANDED for hand in ("left", "right")]


def still_body(left, right):
    keypoints = np.zeros((30, 17, 3))
    keypoints[:, INDEX["pelvis"]] = 0.0, 0.0, 1.0
    keypoints[:, INDEX["left_wrist"]], keypoints[:, INDEX["right_wrist"]] = left, right
    return keypoints


def sequences(admission):
    """How many sequences can still be chosen from."""
    return int(eligible(admission.mask).any(axis=1).sum())


def test_quantities_of_a_known_pose():
    body = still_body((0.3, 0.4, 1.2), (0.0, -0.2, 0.9))
    assert MEASURES["wrist_height"](body)[0] == pytest.approx([0.2, -0.1])
    assert MEASURES["wrist_asymmetry"](body)[0] == pytest.approx([0.3])
    assert MEASURES["hand_radius"](body)[0] == pytest.approx([0.5, 0.2])
    assert MEASURES["hand_span"](body)[0] == pytest.approx([np.sqrt(0.3**2 + 0.6**2 + 0.3**2)])
    assert MEASURES["wrist_speed"](body).max() == 0
    body[:, INDEX["left_wrist"], 0] += 0.5 * np.arange(30) / 15
    assert MEASURES["wrist_speed"](body) == pytest.approx(np.array([[0.5, 0.0]] * 30))


@pytest.mark.parametrize("future", ["real", "zeros"])
def test_speed_looks_at_frames_that_follow_each_other_alone(future):
    generator = np.random.default_rng(4)
    moved = [motion(generator, 128, 0.2, 5.0) for _ in range(2)]
    recordings = [Recording("", keypoints, sound(generator, 128)) for keypoints in moved]
    database = build_database(recordings, {}, future)
    speeds = measure(database)["wrist_speed"].T[database.starts[:, None] + np.arange(64)]
    for recording, keypoints in enumerate(moved):
        first, second = speeds[database.recording == recording]
        expected = MEASURES["wrist_speed"](keypoints)
        assert np.allclose(first, expected[:64], atol=1e-5)
        # Stored alone, the second sequence does not know what came before it.
        known = 4 if future == "zeros" else 0
        assert np.allclose(second[known:60], expected[64 + known : 124], atol=1e-5)


def test_a_long_database_is_measured_like_a_short_one():
    generator = np.random.default_rng(4)
    keypoints = np.concatenate([motion(generator, 20_000, 0.2, 5.0) for _ in range(2)])
    database = build_database([Recording("", keypoints, sound(generator, 40_000))], {})
    for quantity, values in measure(database).items():
        assert np.allclose(values.T[:39_990], MEASURES[quantity](keypoints)[:39_990], atol=1e-5)


def test_left_and_right_change_places_in_the_mirror():
    keypoints = DATABASE.keypoints[:100].astype(np.float64)
    for of in MEASURES.values():
        assert np.allclose(of(mirror(keypoints)), of(keypoints)[:, ::-1])


@pytest.mark.parametrize(("quantity", "hand"), HANDS)
def test_a_percentile_admits_its_share_and_keeps_its_side(quantity, hand):
    for bound, percentile in (("at_least", 85), ("at_most", 15)):
        constraint = Constraint(quantity, bound, percentile, hand)
        mask, threshold = CONTROLS.mask(constraint), CONTROLS.threshold(constraint)
        assert mask.mean() == pytest.approx(0.15, abs=0.01)
        hands = {"left": [0], "right": [1], "both": slice(None)}[hand]
        values = MEASURED[quantity][mask][:, hands]
        assert values.min() >= threshold if bound == "at_least" else values.max() <= threshold


def test_a_value_is_a_threshold_in_its_unit():
    mask = CONTROLS.mask(Constraint("wrist_height", "at_least", 0.25, "left", "value"))
    assert np.array_equal(mask, MEASURED["wrist_height"][..., 0] >= 0.25)


def test_constraints_and_labels_act_together():
    constraints = [
        Constraint("wrist_height", "at_most", 60, "left"),
        Constraint("wrist_speed", "at_most", 70, "right"),
        LabelConstraint("emotion", ("sad", "neutral")),
    ]
    admission = CONTROLS.admit(constraints)
    moods = DATABASE.labelled("emotion", "sad") | DATABASE.labelled("emotion", "neutral")
    expected = CONTROLS.mask(constraints[0]) & CONTROLS.mask(constraints[1]) & moods[:, None]
    assert np.array_equal(admission.mask, expected)
    assert admission.share == eligible(expected).mean()
    assert admission.relaxed == ()


HIGH = Constraint("wrist_height", "at_least", 80, "left")
LOW = Constraint("wrist_height", "at_most", 0.05, "left", "value")


@pytest.mark.parametrize(("high", "low", "stronger"), [(0, 0, HIGH), (0, 1, LOW), (-2, -3, HIGH)])
def test_the_lowest_priority_gives_way_first_and_of_equal_ones_the_later(high, low, stronger):
    asked = [dataclasses.replace(HIGH, priority=high), dataclasses.replace(LOW, priority=low)]
    admission = CONTROLS.admit(asked)
    assert CONTROLS.mask(stronger)[admission.mask].all()
    (said,) = admission.relaxed
    weaker = HIGH if stronger is LOW else LOW
    assert said.startswith(f"{weaker}: relaxed to ")


@pytest.mark.parametrize("bound", ["at_least", "at_most"])
@pytest.mark.parametrize(("quantity", "hand"), HANDS)
def test_what_gives_way_goes_no_further_than_it_must(quantity, hand, bound):
    value = 9.0 if bound == "at_least" else -9.0
    admission = CONTROLS.admit([Constraint(quantity, bound, value, hand, "value")])
    assert sequences(admission) >= ROOM
    (said,) = admission.relaxed
    # The admitted frames are those at a threshold; at the next stricter number, too few sequences are left.
    hands = {"left": [0], "right": [1], "both": slice(None)}[hand]
    outermost, strictest = (np.min, np.inf) if bound == "at_least" else (np.max, -np.inf)
    threshold = outermost(MEASURED[quantity][admission.mask][:, hands])
    for value, few in ((threshold, False), (np.nextafter(threshold, strictest), True)):
        mask = CONTROLS.mask(Constraint(quantity, bound, float(value), hand, "value"))
        assert (eligible(mask).any(axis=1).sum() < ROOM) == few
    percentile = float(said.rsplit(" ", 1)[1])
    constraint = Constraint(quantity, bound, percentile, hand)
    assert CONTROLS.mask(constraint).mean() == pytest.approx(admission.mask.mean(), abs=0.002)


def test_a_third_constraint_holds_where_the_second_gives_way():
    slow = Constraint("wrist_speed", "at_most", 60)
    admission = CONTROLS.admit([HIGH, LOW, slow])
    assert sequences(admission) >= FEWEST
    assert [said.split(":")[0] for said in admission.relaxed] in ([str(LOW)], [str(LOW), str(slow)])
    assert CONTROLS.mask(HIGH)[admission.mask].all()


def test_an_emotion_gives_way_before_the_controls_do():
    fast = Constraint("wrist_speed", "at_least", 90, priority=-5)
    emotion = [LabelConstraint("emotion", ("sad",), priority=1), Constraint("wrist_speed", "at_most", 20)]
    admission = CONTROLS.admit([fast], emotion)
    assert CONTROLS.mask(fast)[admission.mask].all()
    assert admission.relaxed[0] == "emotion sad: dropped"
    assert admission.relaxed[1].startswith("both wrist_speed at most percentile 20: relaxed to ")


@pytest.mark.parametrize("count", [1, 2, 5])
def test_a_database_of_few_sequences_always_leaves_some(count):
    generator = np.random.default_rng(count)
    recordings = [
        Recording("", motion(generator, 64, 0.2, 5.0), sound(generator, 64), {"speaker": f"number {n}"})
        for n in range(count)
    ]
    controls = Controls(build_database(recordings, {}))
    asked = [
        Constraint("wrist_height", "at_least", 100),
        LabelConstraint("speaker", ("number 0",)),
        Constraint("hand_span", "at_most", 0.0, unit="value"),
    ]
    assert sequences(controls.admit(asked)) >= min(count, FEWEST)


def test_a_label_that_the_database_lacks_is_answered_with_those_it_has():
    with pytest.raises(InvalidValueError, match="'glad'; valid: neutral, sad, angry"):
        CONTROLS.check([HIGH, LabelConstraint("emotion", ("sad", "glad"))])
    with pytest.raises(InvalidValueError, match="speaker.*'Ann'"):
        CONTROLS.check([LabelConstraint("speaker", ("Ann",))])


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("wrist_hight", "at_least", 85), "wrist_hight.*wrist_height, wrist_speed"),
        (("wrist_height", "at_least", 85, "middle"), "middle.*left, right, both"),
        (("hand_span", "at_least", 85, "left"), "hand_span: 'left'; valid: both"),
        (("wrist_height", "over", 85), "over.*at_least, at_most"),
        (("wrist_height", "at_least", 85, "left", "cm"), "cm.*percentile, value"),
        (("wrist_height", "at_least", float("nan")), "nan.*finite"),
        (("wrist_height", "at_least", float("inf"), "left", "value"), "inf.*finite"),
        (("wrist_height", "at_least", 101), "101.*0 to 100"),
    ],
)
def test_bad_constraints_are_named(arguments, named):
    with pytest.raises(InvalidValueError, match=named):
        Constraint(*arguments)


@pytest.mark.parametrize("duration", [-1.0, float("nan")])
def test_a_bad_duration_is_named(duration):
    with pytest.raises(InvalidValueError, match=f"{duration}.*0 s or more"):
        LabelConstraint("emotion", ("sad",), duration=duration)


@pytest.mark.parametrize(
    ("kind", "names", "named"), [("mood", ("sad",), "emotion, style, speaker"), ("style", (), "one or more")]
)
def test_bad_labels_are_named(kind, names, named):
    with pytest.raises(InvalidValueError, match=named):
        LabelConstraint(kind, names)
