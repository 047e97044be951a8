"""The database file: what is written is what is read, and damage is named."""

import json

import numpy as np
import pytest
from safetensors.numpy import save_file

from gesture_bot.base.errors import FileFormatError, InvalidValueError
from gesture_bot.base.keypoints import KEYPOINTS
from gesture_bot.corpus import database
from gesture_bot.corpus.database import LOOKAHEAD, SEQUENCE, Database
from gesture_bot.corpus.recordings import Recording, build_database
from gesture_bot.speech.features import SILENCE_FEATURES

STATISTICS = ("keypoint_mean", "keypoint_deviation", "feature_mean", "feature_deviation")
ARRAYS = ("keypoints", "features", "starts", "recording", "labels", *STATISTICS)


def recording(frames: int, emotion: str) -> Recording:
    generator = np.random.default_rng(frames)
    return Recording(
        f"{emotion} {frames}",
        generator.normal(size=(frames, len(KEYPOINTS), 3)).astype(np.float32),
        generator.normal(size=(frames, 28)).astype(np.float32),
        {"emotion": emotion, "speaker": f"speaker {frames % 3}"},
    )


@pytest.fixture
def built() -> Database:
    return build_database(
        [recording(200, "happy"), recording(30, "sad"), recording(64, "happy")],
        {"licence": "CC0", "seed": "7"},
    )


def test_sequences_cover_each_recording_and_keep_their_future(built):
    assert built.starts.tolist() == [0, 64, 128, 136, 214, 292]
    assert built.recording.tolist() == [0, 0, 0, 0, 1, 2]
    assert [built.label(s, "emotion") for s in range(6)] == ["happy"] * 4 + ["sad", "happy"]
    assert [built.label(s, "speaker") for s in range(6)] == ["speaker 2"] * 4 + ["speaker 0", "speaker 1"]
    assert [built.label(s, "style") for s in range(6)] == [""] * 6
    assert built.labelled("emotion", "sad").tolist() == [False] * 4 + [True, False]
    assert len(built.keypoints) == 200 + SEQUENCE + SEQUENCE + 3 * LOOKAHEAD
    assert built.starts.max() + SEQUENCE + LOOKAHEAD == len(built.keypoints)


def test_the_speaker_holds_still_in_silence_after_a_recording(built):
    np.testing.assert_array_equal(built.keypoints[200:214], np.repeat(built.keypoints[199:200], 14, axis=0))
    np.testing.assert_array_equal(built.features[244:292], np.tile(SILENCE_FEATURES, (48, 1)))


def test_the_sound_goes_on_after_a_cut():
    whole = recording(100, "happy")
    cut = Recording("cut", whole.keypoints[:70], whole.features, {})
    built = build_database([cut], {})
    np.testing.assert_array_equal(built.features, whole.features[:84])
    np.testing.assert_array_equal(built.keypoints[70:], np.repeat(whole.keypoints[69:70], 14, axis=0))


def test_zeros_stand_for_the_future_where_the_papers_way_is_asked_for():
    whole = recording(200, "happy")
    built = build_database([whole], {}, future="zeros")
    assert built.starts.tolist() == [0, 78, 156, 234]
    for start, cut in zip(built.starts, (0, 64, 128, 136), strict=True):
        np.testing.assert_array_equal(built.features[start : start + 64], whole.features[cut : cut + 64])
        padding = (built.features[start + 64 : start + 78] - built.feature_mean) / built.feature_deviation
        assert np.abs(padding).max() < 1e-6


def test_statistics_are_those_of_the_sequences(built):
    frames = built.features[np.unique(built.starts[:, None] + np.arange(SEQUENCE))].astype(np.float64)
    assert np.allclose(built.feature_mean, frames.mean(axis=0))
    assert np.allclose(built.feature_deviation, frames.std(axis=0))


def test_what_never_changes_keeps_its_unit():
    keypoints = np.full((300_000, len(KEYPOINTS), 3), 0.1, np.float32)
    built = build_database([Recording("still", keypoints, np.full((300_000, 28), 0.3, np.float32))], {})
    np.testing.assert_array_equal(built.keypoint_deviation, 1.0)
    np.testing.assert_array_equal(built.feature_deviation, 1.0)


def test_labels_that_are_not_there_are_answered_with_those_that_are(built):
    with pytest.raises(InvalidValueError, match="emotion: 'furious'; valid: happy, sad"):
        built.labelled("emotion", "furious")
    with pytest.raises(InvalidValueError, match="'mood'; valid: emotion, style, speaker"):
        built.labelled("mood", "sad")
    with pytest.raises(InvalidValueError, match="label of odd: 'mood'"):
        build_database([Recording("odd", built.keypoints, built.features, {"mood": "sad"})], {})


def test_round_trip(built, tmp_path):
    path = tmp_path / "own.safetensors"
    built.save(path)
    loaded = Database.load(path)
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(loaded, name), getattr(built, name))
    assert loaded.names == built.names
    assert loaded.metadata == {"licence": "CC0", "seed": "7"}


def test_loading_maps_the_file(built, tmp_path):
    path = tmp_path / "own.safetensors"
    built.save(path)
    loaded = Database.load(path)
    for name in ARRAYS:
        base = getattr(loaded, name)
        while isinstance(base, np.ndarray) and not isinstance(base, np.memmap):
            base = base.base
        assert isinstance(base, np.memmap)
        assert not getattr(loaded, name).flags.writeable


def test_the_same_database_is_the_same_file(built, tmp_path):
    built.save(tmp_path / "a.safetensors")
    built.save(tmp_path / "b.safetensors")
    assert (tmp_path / "a.safetensors").read_bytes() == (tmp_path / "b.safetensors").read_bytes()


def test_a_missing_file_and_a_file_of_text_are_named(tmp_path):
    with pytest.raises(FileFormatError, match="nowhere.safetensors"):
        Database.load(tmp_path / "nowhere.safetensors")
    (tmp_path / "text.safetensors").write_text("Not a database, but a letter to a friend.")
    with pytest.raises(FileFormatError, match="text.safetensors"):
        Database.load(tmp_path / "text.safetensors")
    with pytest.raises(FileFormatError, match=tmp_path.name):
        Database.load(tmp_path)


def test_a_place_that_cannot_be_written_is_named(built, tmp_path):
    (tmp_path / "occupied").write_text("")
    with pytest.raises(FileFormatError, match="occupied"):
        built.save(tmp_path / "occupied" / "own.safetensors")


@pytest.mark.parametrize("kept", [0, 5, 100, 10_000, -1])
def test_a_truncated_file_is_refused(built, tmp_path, kept):
    path = tmp_path / "own.safetensors"
    built.save(path)
    path.write_bytes(path.read_bytes()[:kept])
    with pytest.raises(FileFormatError, match="own.safetensors"):
        Database.load(path)


def test_damage_anywhere_in_the_header_is_found(built, tmp_path):
    path = tmp_path / "own.safetensors"
    built.save(path)
    content = path.read_bytes()
    for position in range(8 + int.from_bytes(content[:8], "little")):
        if content[position] != ord(" "):
            path.write_bytes(content[:position] + bytes([content[position] ^ 1]) + content[position + 1 :])
            with pytest.raises(FileFormatError, match="own.safetensors"):
                Database.load(path)


def test_a_changed_byte_is_found(built, tmp_path):
    path = tmp_path / "own.safetensors"
    built.save(path)
    content = bytearray(path.read_bytes())
    content[-1000] ^= 1
    path.write_bytes(content)
    with pytest.raises(FileFormatError, match="checksum"):
        Database.load(path)


def test_changed_labels_are_found(built, tmp_path):
    path = tmp_path / "own.safetensors"
    built.save(path)
    path.write_bytes(path.read_bytes().replace(b"happy", b"angry"))
    with pytest.raises(FileFormatError, match="checksum"):
        Database.load(path)


def test_another_version_is_named(built, tmp_path, monkeypatch):
    path = tmp_path / "own.safetensors"
    with monkeypatch.context() as older:
        older.setattr(database, "VERSION", 0)
        built.save(path)
    with pytest.raises(FileFormatError, match="version .*build it again: 0; valid: 2"):
        Database.load(path)


def test_another_skeleton_is_named(built, tmp_path, monkeypatch):
    path = tmp_path / "own.safetensors"
    with monkeypatch.context() as other:
        other.setattr(database, "KEYPOINTS", tuple(reversed(KEYPOINTS)))
        built.save(path)
    with pytest.raises(FileFormatError, match="skeleton"):
        Database.load(path)


def test_another_safetensors_file_is_refused(tmp_path):
    path = tmp_path / "weights.safetensors"
    save_file({"weights": np.zeros(3)}, path, {"format": json.dumps("pt")})
    with pytest.raises(FileFormatError, match="gesture_bot database"):
        Database.load(path)


def test_an_interrupted_write_leaves_the_old_file(built, tmp_path, monkeypatch):
    path = tmp_path / "own.safetensors"
    built.save(path)
    before = path.read_bytes()

    def half_written(arrays, temporary, header):
        temporary.write_bytes(before[:1000])
        raise KeyboardInterrupt

    monkeypatch.setattr(database, "save_file", half_written)
    with pytest.raises(KeyboardInterrupt):
        built.save(path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_recordings_that_do_not_fit_are_named():
    good = recording(100, "happy")
    with pytest.raises(InvalidValueError, match=r"features of short.*\(90, 28\).*\(100 or more, 28\)"):
        build_database([Recording("short", good.keypoints, good.features[:90])], {})
    with pytest.raises(InvalidValueError, match="holed holds numbers that are not finite"):
        build_database([Recording("holed", good.keypoints * np.nan, good.features)], {})
    with pytest.raises(InvalidValueError, match="no recording"):
        build_database([], {})
