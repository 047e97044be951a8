"""From a take to recordings: known motion arrives where it should, and bad frames do not arrive."""

import re
from pathlib import Path

import numpy as np
import pytest

from gesture_bot.base.errors import FileFormatError
from gesture_bot.base.keypoints import INDEX, KEYPOINTS, bone_lengths
from gesture_bot.corpus import bvh_reader, text_reader
from gesture_bot.corpus.body import Posture, pose
from gesture_bot.corpus.skeletons import choose_skeleton, load_skeleton, load_skeletons
from gesture_bot.corpus.sources import Take
from gesture_bot.corpus.takes import CUT, recordings_of
from gesture_bot.evaluate.motion_files import write_bvh

DATA = Path(__file__).parents[2] / "shared/data"
SPEECH = DATA / "gestures_from_speech"
TRINITY = DATA / "nao_g/NaturalTalking_030_2_1From5.bvh"
SOURCE_AXES = [1, 2, 0]  # the map gesture_bot: x left, y up, z forward
MINUTES = np.zeros((15 * 60 * 10, 28), np.float32)
"""Features for ten minutes."""


def motion(rate, seconds=10.0):
    """(n, 17, 3) smooth motion of the standard body, leaning and turning its head, at any frame rate."""
    times = np.arange(round(rate * seconds)) / rate
    wave = np.sin(2 * np.pi * np.outer(times, [0.31, 0.47, 0.23, 0.53, 0.37]))
    left = [0.28, 0.18, 0.20, 0.3, 0.1] + wave * [0.05, 0.06, 0.08, 0.4, 0.3]
    right = [0.25, 0.22, 0.10, -0.2, 0.0] + wave[:, ::-1] * [0.06, 0.05, 0.06, 0.3, 0.2]
    torso, head = wave[:, :3] * [0.1, 0.1, 0.3], wave[:, 2:] * [0.1, 0.2, 0.3]
    return pose(Posture(left, right, torso, head, 0.2))


def as_take(keypoints, rate, name="made up"):
    return Take(name, KEYPOINTS, keypoints[..., SOURCE_AXES], rate)


def imported(take, skeleton="gesture_bot", features=MINUTES):
    """The keypoints of the one recording that a take becomes."""
    (recording,), _ = recordings_of(take, load_skeleton(skeleton), features, {})
    return recording.keypoints


def worst(a, b):
    """The largest distance between two sets of keypoints [m]."""
    return np.linalg.norm(a - b, axis=-1).max()


@pytest.mark.parametrize("rate", [12, 15, 24, 25, 29.97, 60, 120])
def test_a_known_motion_arrives_from_any_rate(rate):
    got = imported(as_take(motion(rate), rate))
    assert len(got) == (149 if rate == 12 else 150)
    inside = slice(8, -8)  # a low-pass does not know what comes before and after
    assert worst(got[inside], motion(15)[: len(got)][inside]) < 1e-3


def test_another_place_heading_and_unit_make_no_difference():
    keypoints = motion(15)
    turns = np.linspace(0, 7, len(keypoints))
    walked = (
        keypoints
        @ np.array([[[np.cos(a), np.sin(a), 0], [-np.sin(a), np.cos(a), 0], [0, 0, 1]] for a in turns])
        + np.outer(turns, [0.5, -0.2, 0.05])[:, None]
        + [3.0, 1.0, 0.9]
    )
    centimetres_of_a_child = 100 * 0.7 * walked
    assert worst(imported(as_take(centimetres_of_a_child, 15)), keypoints) < 1e-3


def test_other_axes_arrive_with_left_on_the_left(tmp_path):
    """A source with x to the right, y forward and z up, whose joints are numbers."""
    keypoints = motion(15)
    (tmp_path / "own.yaml").write_text(
        "description: a test\naxes: [right, forward, up]\nrate: 15\njoints:\n"
        + "\n".join(f"  {name}: {place}" for place, name in enumerate(KEYPOINTS))
    )
    positions = keypoints[..., [1, 0, 2]] * [-1, 1, 1]
    take = Take("own", tuple(map(str, range(17))), positions, None)
    assert worst(imported(take, str(tmp_path / "own.yaml")), keypoints) < 1e-3


def test_a_source_that_lies_on_its_side_is_named():
    keypoints = motion(15)[..., [0, 2, 1]]
    with pytest.raises(FileFormatError, match="not upright: other axes than the skeleton map gesture_bot"):
        imported(as_take(keypoints, 15))


def test_bvh_comes_back_as_it_was_written(tmp_path):
    path = tmp_path / "motion.bvh"
    write_bvh(path, motion(15), 15)
    (take,) = bvh_reader.read(path)
    skeleton = choose_skeleton(take, path.stem, list(load_skeletons().values()))
    assert skeleton.name == "gesture_bot"
    assert worst(imported(take), motion(15)) < 1e-3


def test_what_the_source_lacks_is_the_standard_body():
    """Arms and a neck alone: the rest stands upright, and hands lie in line with forearms, thumbs up."""
    names = [name for name in KEYPOINTS if name.endswith(("neck", "shoulder", "elbow", "wrist"))]
    standing = motion(15)
    take = Take("arms", tuple(names), standing[:, [INDEX[name] for name in names]], 15)
    skeleton = load_skeleton("gesture_bot").model_copy(
        update={"axes": ("forward", "left", "up"), "joints": {name: (name,) for name in names}}
    )
    (recording,), _ = recordings_of(take, skeleton, MINUTES, {})
    got = recording.keypoints
    np.testing.assert_allclose(bone_lengths(got), np.tile(bone_lengths(standing[0]), (150, 1)), atol=1e-6)
    np.testing.assert_allclose(got[:, INDEX["neck"]], np.tile([0, 0, 0.5], (150, 1)), atol=1e-6)
    assert (got[:, INDEX["head_top"], 2] > 0.7).all()
    assert (got[:, INDEX["left_index"], 2] > got[:, INDEX["left_little"], 2]).all()


def swinging(rate, frequency, angle):
    """A body that stands still but for its left forearm, which swings to and fro."""
    times = np.arange(rate * 20) / rate
    keypoints = np.repeat(motion(15)[:1], len(times), axis=0)
    elbow = keypoints[:, INDEX["left_elbow"]]
    for name in ("left_wrist", "left_index", "left_little"):
        x, y, z = (keypoints[:, INDEX[name]] - elbow).T
        swing = angle * np.sin(2 * np.pi * frequency * times)
        turned = np.stack(
            [np.cos(swing) * x - np.sin(swing) * y, np.sin(swing) * x + np.cos(swing) * y, z], 1
        )
        keypoints[:, INDEX[name]] = elbow + turned
    return keypoints


def test_gestures_pass_and_faster_shaking_does_not_alias():
    size = {}
    for frequency in (3.1, 20.0):
        got = imported(as_take(swinging(120, frequency, 0.1), 120))[15:-15]
        forearm = got[:, INDEX["left_wrist"]] - got[:, INDEX["left_elbow"]]
        size[frequency] = np.ptp(np.arctan2(forearm[:, 1], forearm[:, 0]))
    assert size[3.1] == pytest.approx(0.2, rel=0.03)
    assert size[20.0] < 0.002


def all_counted(counts):
    return counts["read"] == counts["kept"] + sum(counts[why] for why in CUT)


def recordings(keypoints, rate=30, features=MINUTES):
    made, counts = recordings_of(as_take(keypoints, rate), load_skeleton("gesture_bot"), features, {})
    assert all_counted(counts)
    return made, counts


@pytest.mark.parametrize("damage", ["nan", "jump", "long arm"])
def test_a_short_fault_is_mended_and_a_long_one_cut(damage):
    clean = motion(30, 30)
    expected = motion(15, 30)
    for frames in (3, 45):
        keypoints = clean.copy()
        keypoints[400 : 400 + frames, INDEX["right_wrist"]] = {
            "nan": np.nan,
            "jump": [-0.5, 0.4, 0.5],
            "long arm": [0.9, -0.9, -0.9],
        }[damage]
        made, counts = recordings(keypoints)
        if frames == 3:
            assert len(made) == 1
            assert 3 <= counts["mended"] <= 5
            assert worst(made[0].keypoints[8:-8], expected[8:-8]) < 0.03
        else:
            assert len(made) == 2
            assert 45 <= counts["lost"] + counts["jumped"] + counts["broken"] <= 47
            first, second = (recording.keypoints for recording in made)
            assert worst(first[8:-8], expected[8 : len(first) - 8]) < 1e-3
            assert worst(second[8:-8], expected[-len(second) + 8 : -8]) < 1e-3


def test_a_cut_in_the_film_is_no_fast_gesture():
    keypoints = motion(30, 30)
    keypoints[450:] = keypoints[450:][:, [*range(7), *range(12, 17), *range(7, 12)]] * [1, -1, 1]
    keypoints[450:, INDEX["left_wrist"]] += [0.3, 0.3, 0.3]
    made, counts = recordings(keypoints)
    assert len(made) == 2
    assert counts["jumped"] > 0


def test_the_sound_goes_on_after_a_cut():
    keypoints = motion(15, 30)
    keypoints[200:230] = np.nan
    features = np.arange(450 * 28, dtype=np.float32).reshape(450, 28)
    (first, second), _ = recordings(keypoints, 15, features)
    np.testing.assert_array_equal(first.features, features[:214])
    np.testing.assert_array_equal(second.features, features[230:])


def test_motion_without_sound_and_short_stretches_are_left_out():
    keypoints = motion(15, 30)
    keypoints[[60, 61, 62, 63, 64, 65]] = np.nan
    made, counts = recordings(keypoints, 15, np.zeros((300, 28), np.float32))
    assert [len(recording.keypoints) for recording in made] == [300 - 66]
    assert counts == {"read": 450, "kept": 234, "lost": 6, "short": 60, "soundless": 150}


def test_a_recording_that_is_short_altogether_is_kept():
    made, _ = recordings(motion(15, 2), 15)
    assert [len(recording.keypoints) for recording in made] == [30]


@pytest.mark.parametrize(
    ("name", "stem", "labels"),
    [
        ("beat", "2_scott_0_66_66", {"speaker": "scott", "emotion": "happy"}),
        ("beat", "1_wayne_0_103_110", {"speaker": "wayne", "emotion": "scared"}),
        ("beat", "4_lawrence_1_5_5", {"speaker": "lawrence"}),
        ("zeroeggs", "006_Sad_0_x_1_0", {"style": "sad", "emotion": "sad"}),
        ("zeroeggs", "021_Old_0_mirror_x_1_0", {"style": "old"}),
        ("zeroeggs", "something else", {}),
        ("trinity", "NaturalTalking_007", {}),
        ("gestures_from_speech", "oliver_gt_interval_12", {"speaker": "oliver"}),
    ],
)
def test_labels_are_read_from_file_names(name, stem, labels):
    assert load_skeleton(name).labels(stem) == labels


def test_a_map_is_found_by_the_joints_and_then_by_the_file_name():
    maps = list(load_skeletons().values())
    for name, stem in [("beat", "1_wayne_0_1_1"), ("zeroeggs", "001_Neutral_0_x_1_0"), ("trinity", "x")]:
        joints = tuple({joint for named in load_skeleton(name).joints.values() for joint in named})
        assert choose_skeleton(Take("", joints, np.zeros((1, len(joints), 3)), 60), stem, maps).name == name


def test_a_map_that_does_not_fit_lists_the_joints():
    take = Take("", ("Hip", "Thorax"), np.zeros((9, 2, 3)), 30)
    with pytest.raises(FileFormatError, match=r"beat.*its 2 joints: Hip, Thorax"):
        choose_skeleton(take, "", list(load_skeletons().values()))
    with pytest.raises(FileFormatError, match="names joints that are not there.*LeftArm.*found: Hip, Thorax"):
        recordings_of(take, load_skeleton("beat"), MINUTES, {})


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ("axes: [left, up, down]", "axes must name one each"),
        ("axes: [left, up, ahead]", "'ahead'"),
        ("file_name: '('", "file_name and sound"),
        ("sound: '{take}'", "take"),
        ("joints: {neck: Neck}", "lacks left_shoulder"),
        ("joints: {nose: Nose}", "unknown keypoints nose; valid: pelvis"),
        ("unit: cm", "unit"),
    ],
)
def test_a_wrong_map_says_where(tmp_path, change, named):
    lines = {"description": "description: a test", "axes": "axes: [left, up, forward]"}
    lines["joints"] = "joints:\n" + "\n".join(f"  {name}: {name}" for name in KEYPOINTS)
    lines[change.partition(":")[0]] = change
    (tmp_path / "own.yaml").write_text("\n".join(lines.values()))
    with pytest.raises(FileFormatError, match=rf"own\.yaml.*{named}"):
        load_skeleton(str(tmp_path / "own.yaml"))


def test_a_table_with_names_reads_as_one_without(tmp_path):
    keypoints = motion(15, 3)
    header = ",".join(["frame", *(f"{name}_{axis}" for name in KEYPOINTS for axis in "xyz")])
    table = np.column_stack([np.arange(45), keypoints.reshape(45, -1)])
    np.savetxt(tmp_path / "named.csv", table, delimiter=",", header=header, comments="")
    np.savetxt(tmp_path / "plain.txt", table[:, 1:])
    for name in ("named.csv", "plain.txt"):
        assert text_reader.fits(tmp_path / name)
        (take,) = text_reader.read(tmp_path / name)
        np.testing.assert_allclose(take.positions, keypoints)
    lines = (tmp_path / "named.csv").read_text().splitlines()
    lines[3] = ",".join("" if 30 < place < 36 else cell for place, cell in enumerate(lines[3].split(",")))
    (tmp_path / "named.csv").write_text("\n".join(lines))
    (take,) = text_reader.read(tmp_path / "named.csv")
    assert np.isnan(take.positions[2, 10]).all()
    (tmp_path / "plain.txt").write_text("\n".join([lines[4].replace(",", " "), "1 2 3"]))
    with pytest.raises(FileFormatError, match=r"plain\.txt: frame 2"):
        list(text_reader.read(tmp_path / "plain.txt"))


def test_a_table_from_a_spreadsheet_program_begins_with_a_mark(tmp_path):
    header = ",".join(f"{name}_{axis}" for name in KEYPOINTS for axis in "xyz")
    (tmp_path / "own.csv").write_text(f"{header}\n{','.join('1' * 51)}\n", encoding="utf-8-sig")
    assert text_reader.fits(tmp_path / "own.csv")
    (take,) = text_reader.read(tmp_path / "own.csv")
    assert take.joints == KEYPOINTS


def test_transcripts_are_no_keypoints(tmp_path):
    (tmp_path / "words.txt").write_text("01_beat_align 0 68.0 68.0 0.1\n")
    (tmp_path / "times.csv").write_text("0.5,0.7,hello\n")
    assert not text_reader.fits(tmp_path / "words.txt")
    assert not text_reader.fits(tmp_path / "times.csv")


@pytest.mark.parametrize("content", ["", "HIERARCHY\nROOT Hips\n{\n", "no motion at all", "cut", "\0\1"])
def test_a_broken_bvh_is_named(tmp_path, content):
    path = tmp_path / "broken.bvh"
    write_bvh(path, motion(15, 1), 15)
    path.write_text(path.read_text()[:-3000] if content == "cut" else content)
    with pytest.raises(FileFormatError, match=r"broken\.bvh"):
        list(bvh_reader.read(path))


def test_a_missing_bvh_is_named(tmp_path):
    with pytest.raises(FileFormatError, match=r"cannot read .*none\.bvh \(no such file\)"):
        list(bvh_reader.read(tmp_path / "none.bvh"))


@pytest.mark.parametrize(("frame_time", "rate"), [("0.008333", 120), ("0.04167", 24), ("0.0333667", 29.97)])
def test_a_rounded_frame_time_does_not_drift(tmp_path, frame_time, rate):
    path = tmp_path / "motion.bvh"
    write_bvh(path, motion(15, 1), 15)
    path.write_text(re.sub("(?<=Frame Time: ).*", frame_time, path.read_text()))
    (take,) = bvh_reader.read(path)
    assert take.rate == pytest.approx(rate, rel=1e-6)


@pytest.mark.skipif(not SPEECH.exists(), reason="../shared/data/gestures_from_speech is not there")
@pytest.mark.parametrize("path", sorted(SPEECH.glob("*.txt")), ids=lambda path: path.stem)
def test_speakers_on_video_gesture_in_front_of_themselves(path):
    (take,) = text_reader.read(path)
    keypoints = imported(take, "gestures_from_speech")
    assert len(keypoints) == len(take.positions)
    looks_like_a_person(keypoints)


@pytest.mark.skipif(not TRINITY.exists(), reason="../shared/data/nao_g is not there")
def test_motion_capture_of_a_speaker_looks_like_a_person():
    (take,) = bvh_reader.read(TRINITY)
    assert choose_skeleton(take, TRINITY.stem, list(load_skeletons().values())).name == "trinity"
    keypoints = imported(take, "trinity")
    assert len(keypoints) == pytest.approx(len(take.positions) / 12 * 15, abs=1)
    looks_like_a_person(keypoints)
    # Where a hand hangs down, its thumb side is in front.
    hanging = keypoints[:, INDEX["left_wrist"], 2] < 0
    assert hanging.sum() > 50
    front = keypoints[hanging][:, INDEX["left_index"], 0] - keypoints[hanging][:, INDEX["left_little"], 0]
    assert np.median(front) > 0.01


def looks_like_a_person(keypoints):
    np.testing.assert_allclose(
        bone_lengths(keypoints), bone_lengths(motion(15)[:1]).repeat(len(keypoints), 0), atol=1e-5
    )
    mean = dict(zip(KEYPOINTS, keypoints.mean(axis=0), strict=True))
    for side, sign in (("left", 1), ("right", -1)):
        assert sign * mean[f"{side}_shoulder"][1] > 0.15
        assert sign * mean[f"{side}_wrist"][1] > 0.05
        assert mean[f"{side}_wrist"][0] > mean[f"{side}_elbow"][0] + 0.05
        assert -0.1 < mean[f"{side}_wrist"][2] < 0.4
    assert mean["head_top"][2] > mean["neck"][2] + 0.2
    speed = np.linalg.norm(np.diff(keypoints[:, INDEX["right_wrist"]], axis=0), axis=1) * 15
    assert 0.02 < np.median(speed) < 0.6
    assert speed.max() < 5
