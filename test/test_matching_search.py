"""The plain search, held against a slow literal transcription of the method, and the fast one against it."""

import math

import numpy as np
import pytest
from large_database import large_database, random_mask
from small_database import small_database

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.keypoints import INDEX, MATCHED
from gesture_bot.corpus.database import Database
from gesture_bot.matching import kernels
from gesture_bot.matching.codes import BYTE, SHORT, FrameCodes, PoseCodes
from gesture_bot.matching.contest import Contest, Distances
from gesture_bot.matching.features import poses, sounds
from gesture_bot.matching.reference import Reference
from gesture_bot.matching.search import Search, eligible

DATABASE = small_database(recordings=10)
SEARCH, REFERENCE = Search(DATABASE), Reference(DATABASE)
BOTH = pytest.mark.parametrize("search", [SEARCH, REFERENCE], ids=["fast", "plain"])
SEQUENCES = len(DATABASE.starts)


# Numbers of every frame in standard deviations from the mean.
KEYPOINTS = (DATABASE.keypoints - DATABASE.keypoint_mean) / DATABASE.keypoint_deviation
POSES = np.concatenate([KEYPOINTS[:, INDEX[name]] for name in MATCHED], axis=1)
SOUNDS = ((DATABASE.features - DATABASE.feature_mean) / DATABASE.feature_deviation)[:, :14]


def pose_feature(row):
    return [number for offset in (0, 2, 4, 6) for number in POSES[row + offset].tolist()]


def audio_feature(row):
    return [number for offset in range(0, 16, 2) for number in SOUNDS[row + offset].tolist()]


# The features of every window, so that the reference is only slow where the method is.
POSE_FEATURES = [[pose_feature(start + f) for f in range(57)] for start in DATABASE.starts]
AUDIO_FEATURES = [[audio_feature(start + f) for f in range(57)] for start in DATABASE.starts]


def cosine_distance(a, b):
    if a == b:
        return 0.0
    return 1 - sum(x * y for x, y in zip(a, b, strict=True)) / (math.hypot(*a) * math.hypot(*b))


def literal_search(pose_query, audio_query, mask, k, preselection):
    """The search of MM22, step by step: sequence and frame of the winner, and the number of survivors."""
    measures = {"pose": (math.dist, POSE_FEATURES, pose_query)}
    measures["audio"] = (cosine_distance, AUDIO_FEATURES, audio_query)
    first = measures["audio" if preselection == "audio" else "pose"]
    survivors = []
    for sequence in range(SEQUENCES):
        best, best_frame = math.inf, None
        for frame in range(64 - 8 + 1):
            if mask[sequence, frame] and mask[sequence, frame + 7]:
                measure, features, query = first
                distance = measure(features[sequence][frame], query)
                if distance != 0 and distance < best:
                    best, best_frame = distance, frame
        if best_frame is not None:
            survivors.append((sequence, best_frame))
    if not survivors:
        return None
    sums = [0] * len(survivors)
    for name in ("pose",) if preselection == "pose_only" else ("pose", "audio"):
        measure, features, query = measures[name]
        distances = [measure(features[sequence][frame], query) for sequence, frame in survivors]
        for rank, survivor in enumerate(sorted(range(len(survivors)), key=lambda i: distances[i])):
            sums[survivor] += rank
    order = sorted(range(len(survivors)), key=lambda i: sums[i])
    return *survivors[order[min(k, len(order)) - 1]], len(survivors)


def random_query(generator):
    """A row of the database or something between two, for pose and sound."""
    rows = generator.integers(0, len(POSES) - 14, 4)
    share = generator.choice([0.0, 0.4])
    pose = (1 - share) * np.array(pose_feature(rows[0])) + share * np.array(pose_feature(rows[1]))
    audio = (1 - share) * np.array(audio_feature(rows[2])) + share * np.array(audio_feature(rows[3]))
    return pose, audio


@pytest.mark.parametrize("preselection", ["pose", "audio", "pose_only"])
@pytest.mark.parametrize("share", [0.02, 0.15, 0.5, 1.0])
def test_finds_what_the_method_finds(preselection, share):
    generator = np.random.default_rng([int(100 * share), len(preselection)])
    for k in [*range(1, 16), *range(1, 11)]:
        pose, audio = random_query(generator)
        # Runs of frames, as a control would leave them, and scattered ones.
        curve = (
            generator.random((SEQUENCES, 64)) if k % 2 else np.repeat(generator.random((SEQUENCES, 8)), 8, 1)
        )
        mask = curve < share
        expected = literal_search(pose.tolist(), audio.tolist(), mask, k, preselection)
        match = REFERENCE.find(pose, audio, mask, k, preselection)
        assert (match and (match.sequence, match.frame, match.candidates)) == expected
        assert SEARCH.find(pose, audio, mask, k, preselection) == match


@pytest.fixture(scope="module")
def large():
    """1,000 sequences, the last 50 of which say and do the same as the first."""
    database = large_database(1000, repeated=50)
    return database, Search(database), Reference(database)


@pytest.mark.parametrize(("preselection", "queries"), [("pose", 500), ("audio", 250), ("pose_only", 250)])
def test_the_fast_search_finds_what_the_plain_one_finds(large, preselection, queries):
    database, fast, plain = large
    generator = np.random.default_rng(len(preselection))
    for query in range(queries):
        # The sound of the same row as the pose, of another one, or something that is nowhere.
        row, other = generator.integers(0, len(database.keypoints) - 14, 2)
        pose, audio = fast.pose_at(row), fast.audio_of(database.features[generator.choice([row, other]) :])
        if query % 3 == 0:
            pose, audio = pose + generator.normal(size=96), audio + 0.3 * generator.normal(size=112)
        mask = random_mask(generator, 1000, (0.02, 0.15, 0.5, 1.0)[query % 4])
        if query % 5 == 0:
            mask[50:950] = False  # what is left is there twice
        k = 1 + query % 15
        found = fast.find(pose, audio, mask, k, preselection)
        assert found == plain.find(pose, audio, mask, k, preselection)


def test_processors_without_avx2_find_the_same(large, monkeypatch):
    database, search, plain = large
    monkeypatch.setattr(kernels, "_LIBRARY", kernels._load(""))
    generator = np.random.default_rng(7)
    for query in range(60):
        row, other = generator.integers(0, len(database.keypoints) - 14, 2)
        pose, audio = search.pose_at(row), search.audio_of(database.features[other:])
        mask = random_mask(generator, 1000, (0.02, 0.15, 0.5, 1.0)[query % 4])
        preselection = ("pose", "audio", "pose_only")[query % 3]
        found = search.find(pose, audio, mask, 1 + query % 15, preselection)
        assert found == plain.find(pose, audio, mask, 1 + query % 15, preselection)


@pytest.mark.parametrize("preselection", ["pose", "audio"])
def test_every_distance_lies_between_its_bounds(preselection):
    """With frames far from all others and silent ones, whose codes lose most."""
    generator = np.random.default_rng(8)
    database = large_database(100, seed=8)
    database.keypoints[generator.integers(0, len(database.keypoints), 20)] *= 30
    database.features[500:600] *= 1e-6
    pose_stream, sound_stream = poses(database), sounds(database)
    codes = [
        PoseCodes(pose_stream, database.starts),
        FrameCodes(pose_stream, database.starts, SHORT),
        FrameCodes(sound_stream, database.starts, BYTE),
        FrameCodes(sound_stream, database.starts, SHORT),
    ]
    for _ in range(50):
        row, other = generator.integers(0, len(database.keypoints) - 14, 2)
        pose = Distances(pose_stream, pose_stream.at(np.array([row]))[0] + 0.1, 100)
        sound = Distances(sound_stream, sound_stream.at(np.array([other]))[0] + 0.1, 100)
        ranked = [sound, pose] if preselection == "audio" else [pose, sound]
        mask = random_mask(generator, 100, 0.5)
        tables = [one.table for one in codes]
        contest = Contest(database.starts, mask, 1, tables, ranked, pose, sound)
        for sequence in np.flatnonzero(eligible(mask).any(axis=1)):
            frames = np.flatnonzero(eligible(mask)[sequence])
            rows = database.starts[sequence] + frames
            frame = frames[ranked[0].exact(rows).argmin()]
            for by in ranked:
                exact = by.exact(database.starts[sequence] + np.array([frame]))[0]
                assert by.near[sequence] <= exact <= by.far[sequence]
        assert contest.candidates == eligible(mask).any(axis=1).sum()


@BOTH
def test_ties_go_to_the_first_sequence(search):
    """The last recording repeats the first, and both alone are allowed: every distance ties."""
    mask = np.zeros((SEQUENCES, 64), bool)
    last = DATABASE.recording.max()
    mask[(DATABASE.recording == 0) | (DATABASE.recording == last)] = True
    generator = np.random.default_rng(3)
    for _ in range(20):
        pose, audio = random_query(generator)
        for preselection in ("pose", "audio", "pose_only"):
            match = search.find(pose, audio, mask, 1, preselection)
            assert DATABASE.recording[match.sequence] == 0
            expected = literal_search(pose.tolist(), audio.tolist(), mask, 1, preselection)
            assert (match.sequence, match.frame, match.candidates) == expected


@BOTH
def test_the_own_frame_of_the_query_is_skipped(search):
    row = SEARCH.row(5, 20)
    pose, audio = SEARCH.pose_at(row), SEARCH.audio_of(DATABASE.features[row:])
    match = search.find(pose, audio, np.ones((SEQUENCES, 64), bool))
    assert match.pose_distance > 0
    only = np.zeros((SEQUENCES, 64), bool)
    only[5, [20, 27]] = True
    assert search.find(pose, audio, only) is None


@BOTH
def test_distances_are_those_of_the_window_found(search):
    generator = np.random.default_rng(1)
    pose, audio = random_query(generator)
    match = search.find(pose, audio, np.ones((SEQUENCES, 64), bool))
    assert match.pose_distance == pytest.approx(math.dist(POSE_FEATURES[match.sequence][match.frame], pose))
    expected = cosine_distance(AUDIO_FEATURES[match.sequence][match.frame], audio.tolist())
    assert match.audio_distance == pytest.approx(expected)


def test_queries_from_outside_agree_with_rows_of_the_database():
    row = SEARCH.row(7, 3)
    assert np.allclose(SEARCH.pose_at(row), pose_feature(row))
    assert np.array_equal(SEARCH.audio_of(DATABASE.features[row : row + 15]), audio_feature(row))
    held = SEARCH.pose_of(DATABASE.keypoints[row]).reshape(4, 24)
    assert np.allclose(held, POSES[row])


@BOTH
def test_nothing_eligible_is_said(search):
    pose, audio = random_query(np.random.default_rng(0))
    assert search.find(pose, audio, np.zeros((SEQUENCES, 64), bool)) is None


@BOTH
@pytest.mark.parametrize(
    ("k", "preselection", "valid"), [(0, "pose", "1 to 15"), (16, "pose", "1 to 15"), (1, "x", "pose_only")]
)
def test_bad_settings_are_named(search, k, preselection, valid):
    pose, audio = random_query(np.random.default_rng(0))
    with pytest.raises(InvalidValueError, match=valid):
        search.find(pose, audio, np.ones((SEQUENCES, 64), bool), k, preselection)


@BOTH
@pytest.mark.parametrize("broken", ["pose", "audio"])
@pytest.mark.parametrize("number", [np.nan, np.inf, 1e7])
def test_a_query_that_makes_no_sense_is_named(search, broken, number):
    queries = dict(zip(("pose", "audio"), random_query(np.random.default_rng(0)), strict=True))
    queries[broken][3] = number
    with pytest.raises(InvalidValueError, match=broken):
        search.find(queries["pose"], queries["audio"], np.ones((SEQUENCES, 64), bool))


@BOTH
@pytest.mark.parametrize("shape", [(SEQUENCES - 1, 64), (SEQUENCES, 60), (64,)])
def test_a_mask_of_another_shape_is_named(search, shape):
    pose, audio = random_query(np.random.default_rng(0))
    with pytest.raises(InvalidValueError, match="control mask"):
        search.find(pose, audio, np.ones(shape, bool))


def test_a_body_that_never_moves_is_searched_without_warnings(recwarn):
    still = large_database(3)
    still.keypoints[:] = still.keypoints[0]
    pose, audio = random_query(np.random.default_rng(0))
    mask = np.ones((3, 64), bool)
    assert Search(still).find(pose, audio, mask) == Reference(still).find(pose, audio, mask)
    assert not recwarn.list


def test_a_mapped_file_is_given_back_and_read_again(tmp_path):
    DATABASE.save(tmp_path / "database.safetensors")
    mapped = Search(Database.load(tmp_path / "database.safetensors"))
    mask, generator = np.ones((SEQUENCES, 64), bool), np.random.default_rng(4)
    for _ in range(20):
        pose, audio = random_query(generator)
        assert mapped.find(pose, audio, mask) == SEARCH.find(pose, audio, mask)
