"""Controls: what they measure, what they mask, and how they give way."""

import numpy as np
import pytest
from small_database import small_database

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.keypoints import INDEX, mirror
from gesture_bot.matching.controls import FEWEST, Constraint, Controls
from gesture_bot.matching.quantities import MEASURES, measure
from gesture_bot.matching.search import eligible

DATABASE = small_database()
CONTROLS = Controls(DATABASE)
QUANTITIES = measure(DATABASE)


def still_body(left, right):
    keypoints = np.zeros((30, 17, 3))
    keypoints[:, INDEX["pelvis"]] = 0.0, 0.0, 1.0
    keypoints[:, INDEX["left_wrist"]], keypoints[:, INDEX["right_wrist"]] = left, right
    return keypoints


def test_quantities_of_a_known_pose():
    body = still_body((0.3, 0.4, 1.2), (0.0, -0.2, 0.9))
    assert MEASURES["wrist_height"](body)[0] == pytest.approx([0.2, -0.1])
    assert MEASURES["wrist_asymmetry"](body)[0] == pytest.approx([0.3, 0.3])
    assert MEASURES["hand_radius"](body)[0] == pytest.approx([0.5, 0.2])
    assert MEASURES["wrist_speed"](body).max() == 0
    body[:, INDEX["left_wrist"], 0] += 0.5 * np.arange(30) / 15
    assert MEASURES["wrist_speed"](body)[4:-4] == pytest.approx(np.array([[0.5, 0.0]] * 22))


def test_speed_does_not_look_across_recordings():
    first = DATABASE.starts[DATABASE.recording == 1][0]
    alone = MEASURES["wrist_speed"](DATABASE.keypoints[first : first + 214].astype(np.float64))
    sequence = int(np.flatnonzero(DATABASE.recording == 1)[0])
    assert np.allclose(QUANTITIES["wrist_speed"][sequence], alone[:64])


def test_left_and_right_change_places_in_the_mirror():
    keypoints = DATABASE.keypoints[:100].astype(np.float64)
    for of in MEASURES.values():
        assert np.allclose(of(mirror(keypoints)), of(keypoints)[:, ::-1])


@pytest.mark.parametrize("quantity", list(MEASURES))
@pytest.mark.parametrize("hand", ["left", "right", "both"])
def test_a_percentile_admits_its_share_and_keeps_its_side(quantity, hand):
    for bound, percentile in (("at_least", 85), ("at_most", 15)):
        constraint = Constraint(quantity, hand, bound, percentile)
        mask, threshold = CONTROLS.mask(constraint), CONTROLS.threshold(constraint)
        assert mask.mean() == pytest.approx(0.15, abs=0.01)
        hands = {"left": [0], "right": [1], "both": [0, 1]}[hand]
        values = QUANTITIES[quantity][mask][:, hands]
        assert values.min() >= threshold if bound == "at_least" else values.max() <= threshold


def test_a_value_is_a_threshold_in_its_unit():
    mask = CONTROLS.mask(Constraint("wrist_height", "left", "at_least", 0.25, "value"))
    assert np.array_equal(mask, QUANTITIES["wrist_height"][..., 0] >= 0.25)


def test_constraints_and_labels_act_together():
    constraints = [
        Constraint("wrist_height", "left", "at_most", 60),
        Constraint("wrist_speed", "right", "at_most", 70),
    ]
    admission = CONTROLS.admit(constraints, ["sad"])
    sad = (DATABASE.emotion == DATABASE.emotions.index("sad"))[:, None]
    expected = CONTROLS.mask(constraints[0]) & CONTROLS.mask(constraints[1]) & sad
    assert np.array_equal(admission.mask, expected)
    assert admission.share == eligible(expected).mean()
    assert admission.relaxed == ()


def test_labels_that_the_database_lacks_count_for_nothing():
    assert CONTROLS.admit([], ["furious"]).share == 1.0


def test_the_last_constraint_gives_way_and_only_so_far():
    strong = Constraint("wrist_height", "left", "at_least", 80)
    impossible = Constraint("wrist_height", "left", "at_most", 0.05, "value")
    admission = CONTROLS.admit([strong, impossible])
    assert (eligible(admission.mask).any(axis=1)).sum() == FEWEST
    assert CONTROLS.mask(strong)[admission.mask].all()
    (said,) = admission.relaxed
    assert said.startswith("left wrist_height at most 0.05 m: relaxed to percentile 8")


def test_weak_demands_give_way_first_and_then_the_labels():
    high = Constraint("wrist_height", "both", "at_least", 95)
    admission = CONTROLS.admit([high], ["sad"], [Constraint("wrist_speed", "both", "at_most", 1)])
    assert admission.relaxed == ("both wrist_speed at most percentile 1: dropped", "emotion sad: dropped")
    assert np.array_equal(admission.mask, CONTROLS.mask(high))


@pytest.mark.parametrize("bound", ["at_least", "at_most"])
def test_what_nobody_ever_did_still_leaves_something(bound):
    value = 9.0 if bound == "at_least" else -9.0
    admission = CONTROLS.admit([Constraint("wrist_height", "both", bound, value, "value")])
    assert admission.share > 0
    assert len(admission.relaxed) == 1


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("wrist_hight", "left", "at_least", 85), "wrist_hight.*wrist_height, wrist_speed"),
        (("wrist_height", "middle", "at_least", 85), "middle.*left, right, both"),
        (("wrist_height", "left", "over", 85), "over.*at_least, at_most"),
        (("wrist_height", "left", "at_least", 85, "cm"), "cm.*value, percentile"),
        (("wrist_height", "left", "at_least", float("nan")), "nan.*finite"),
        (("wrist_height", "left", "at_least", float("inf"), "value"), "inf.*finite"),
        (("wrist_height", "left", "at_least", 101), "101.*0 to 100"),
    ],
)
def test_bad_constraints_are_named(arguments, named):
    with pytest.raises(InvalidValueError, match=named):
        Constraint(*arguments)
