"""Banks of one's own: poses by name, spans of recordings, and mistakes named with their place."""

import numpy as np
import pytest
from small_database import small_database

from gesture_bot.base.errors import FileFormatError
from gesture_bot.base.keypoints import INDEX, bone_lengths
from gesture_bot.evaluate.motion_files import write_bvh
from gesture_bot.matching.banks import WatchedBanks, load_banks, read_bank, triggers
from gesture_bot.matching.rendering import render
from gesture_bot.matching.settling import rest_pose

REST = rest_pose(small_database())

BANK = """
poses:
  salute: {wrist: {forward: 0.3, out: -0.1, up: 0.35}, palm: down in}
gestures:
  wave:
    triggers: [ahoy, good day: 2]
    mirrored: true
    keyframes:
      - time: 0.0
        hold: 0.2
        right: {wrist: {forward: 0.4, up: 0.3}, palm: forward, fingers: up out}
      - time: 0.4
        right: salute
      - {time: 0.8, right: offer, head: {nod: 5}}
    variants:
      - emotions: [sad, tired]
        keyframes:
          - {time: 0.0, right: home}
"""


def read(tmp_path, *banks):
    for number, bank in enumerate(banks):
        (tmp_path / f"bank{number}.yaml").write_text(bank)
    return load_banks(tmp_path)


def test_a_bank_of_ones_own(tmp_path):
    gestures = read(tmp_path, BANK)
    assert triggers(gestures) == {"ahoy": "wave", "good day": "wave"}
    wave = gestures["wave"]
    assert (wave.weight("good day"), wave.weight("ahoy"), wave.weight("anything")) == (2, 1, 1)
    assert wave.variant("tired").keyframes[0].right.wrist.forward == pytest.approx(0.46)
    assert wave.variant("happy") is None


def test_yes_and_no_are_words(tmp_path):
    gestures = read(tmp_path, BANK.replace("ahoy", "yes, on").replace("wave:", "no:"))
    assert triggers(gestures) == {"yes": "no", "on": "no", "good day": "no"}


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ("palm: forward", "palm: sideways", r"line 11: .*right\.palm: .*forward, back, out, in.*sideways"),
        ("palm: forward", "palm: up down", r"line 11: .*palm: .*up down"),
        ("forward: 0.4", "forward: 4", r"line 11: .*right\.wrist\.forward: .*less than.* 1 .*got 4"),
        ("fingers:", "thumb:", r"line 11: .*has no thumb: one of wrist, palm, fingers, elbow"),
        ("right: salute", "right: saluet", r"line 13: .*right: is no pose: one of .*chest.*salute.*saluet"),
        ("time: 0.4", "time: 0.1", r"line 8: .*0.1 s must come after .* 0.0 s, .* held for 0.2 s"),
        ("time: 0.0", "time: 0.1", r"line 8: .*the stroke, time 0"),
        ("time: 0.4", "time: 400", r"line 12: .*keyframes\.1\.time: .*less than.* 15 .*got 400"),
        ("hold: 0.2", "hold: long", r"line 10: .*keyframes\.0\.hold: .*number.*long"),
        ("ahoy", "Ahoy", r"line 6: .*triggers\.0.*lower-case.*Ahoy"),
        ("ahoy", "12", r"line 6: .*triggers\.0.*string.*got 12"),
        ("good day: 2", "good day: -2", r"line 6: .*triggers\.1\.weight: .*greater than 0.*-2"),
        ("good day: 2", "ahoy", r"line 6: .*triggers\.1: is a trigger of wave already: 'ahoy'"),
        ("triggers:", "trigger:", r"line 5: gestures\.wave: has no trigger: one of .*triggers"),
        ("[sad, tired]", "[sad, tierd]", r"line 16: .*emotions\.1: .*'neutral'.*tierd"),
        ("head: {nod: 5}", "left: chest", r"line 8: .*first keyframe must pose the left arm"),
        ("      - time: 0.0", "      - both: chest\n        time: 0.0", r"line 8: .*`both` arms or"),
        ("hold: 0.2", "time: 0.2", r"not YAML.*'time' is there twice.*line 10"),
        ("    keyframes", "  keyframes", r"not YAML.*line"),
        (
            "mirrored: true\n    keyframes",
            "mirrored: true\n    poses",
            r"line 5: gestures\.wave: has no poses",
        ),
    ],
)
def test_a_mistake_is_named_with_its_place(tmp_path, old, new, named):
    with pytest.raises(FileFormatError, match=named) as error:
        read(tmp_path, BANK.replace(old, new, 1))
    assert str(tmp_path / "bank0.yaml") in str(error.value)
    assert "\n" not in str(error.value)


def test_a_trigger_calls_one_gesture(tmp_path):
    with pytest.raises(FileFormatError, match="bank1.yaml: line 6: .*trigger of wave already: 'ahoy'"):
        read(tmp_path, BANK, BANK.replace("wave:", "salute:"))
    with pytest.raises(FileFormatError, match="bank1.yaml: line 5: gestures.wave: .*there already"):
        read(tmp_path, BANK, BANK.replace("[ahoy, good day: 2]", "[hullo]"))


def test_banks_that_change_are_read_again_and_a_mistake_changes_nothing(tmp_path):
    path = tmp_path / "bank.yaml"
    path.write_text(BANK)
    watched = WatchedBanks(tmp_path)
    assert not watched.changed()
    path.write_text(BANK.replace("ahoy", "hullo there"))
    assert watched.changed()
    assert "hullo there" in triggers(watched.gestures)
    path.write_text(BANK.replace("palm: forward", "palm: sideways"))
    with pytest.raises(FileFormatError, match=r"bank.yaml: line 11: .*right\.palm"):
        watched.changed()
    assert "hullo there" in triggers(watched.gestures)
    assert not watched.changed(), "a mistake is told once"
    (tmp_path / "more.yaml").write_text(BANK.replace("wave:", "nod:").replace("ahoy, good day: 2", "aye"))
    path.unlink()
    assert watched.changed()
    assert set(watched.gestures) == {"nod"}


SPAN = """
gestures:
  shown:
    triggers: [like this]
    recording: {file: wave.bvh, from: 0.5, to: 2.0, stroke: 1.2}
"""


@pytest.fixture(scope="module")
def span(tmp_path_factory):
    """A bank beside a recording at 60 frames a second of somebody larger who waves."""
    folder = tmp_path_factory.mktemp("recorded")
    times = np.arange(180) / 60
    shown = load_banks()["hello"]
    recorded = render(shown, times - 1.2, 0.65, np.repeat(REST[None], 180, axis=0))
    write_bvh(folder / "wave.bvh", 1.15 * recorded, 60)
    (folder / "bank.yaml").write_text(SPAN)
    return folder, times, recorded


def test_a_span_of_a_recording_is_made_as_recorded(span):
    folder, times, recorded = span
    gesture = read_bank(folder / "bank.yaml")["shown"]
    assert (gesture.movement.first, gesture.movement.last) == pytest.approx((-0.7, 0.8))
    keypoints = render(gesture, times - 1.2, 0.4, np.repeat(REST[None], 180, axis=0))
    inside = (times >= 0.5) & (times <= 2.0)
    wrist = INDEX["right_wrist"]
    assert np.abs(keypoints[inside, wrist] - recorded[inside, wrist]).max() < 0.03
    assert np.allclose(bone_lengths(keypoints), bone_lengths(REST), atol=1e-6)
    assert np.allclose(keypoints[0], REST, atol=1e-3)


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ("wave.bvh", "wav.bvh", r"line 5: gestures\.shown\.recording: cannot read .*wav\.bvh"),
        ("wave.bvh", "bank.yaml", r"line 5: .*no recording that can be read.*bank\.yaml"),
        ("stroke: 1.2", "stroke: 2.2", r"line 5: .*the stroke, 2.2 s, must lie in the span, from 0.5 to 2.0"),
        (
            "to: 2.0",
            "to: 9.0",
            r"line 5: .*does not show the speaker from 0.5 to 9.0 s; valid: 0.00 to 2.98 s",
        ),
        (
            "    recording",
            "    keyframes: [{time: 0, right: chest}]\n    recording",
            r"line 3: .*shown: .*either",
        ),
        ("stroke: 1.2", "stroke: 1.2, map: beat", r"line 5: .*map beat names joints that are not there: "),
        ("stroke: 1.2", "stroke: 1.2, map: best", r"line 5: .*unknown skeleton map: 'best'; valid: .*beat"),
    ],
)
def test_a_mistake_in_a_span_is_named_with_its_place(span, old, new, named):
    folder, *_ = span
    (folder / "wrong.yaml").write_text(SPAN.replace(old, new))
    with pytest.raises(FileFormatError, match=named):
        read_bank(folder / "wrong.yaml")


def test_a_folder_without_a_bank_is_named(tmp_path):
    with pytest.raises(FileFormatError, match=f"no semantic banks.*{tmp_path.name}"):
        load_banks(tmp_path)
