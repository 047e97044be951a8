"""Data sets whose speech features are computed already, and those that are arrays: LSG21 and MediaPipe's."""

from pathlib import Path

import numpy as np
import pytest
from small_database import motion

from gesture_bot.base.errors import FileFormatError
from gesture_bot.base.keypoints import INDEX, KEYPOINTS, bone_lengths
from gesture_bot.cli.main import main
from gesture_bot.corpus import landmarks_reader, lsg21_reader
from gesture_bot.corpus.database import Database
from gesture_bot.corpus.precomputed import Sound, features_like_ours
from gesture_bot.corpus.skeletons import load_skeleton
from gesture_bot.matching.speaker import LEAST_SPEECH
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.features import COEFFICIENTS, SILENCE_FEATURES, STATIC, speech_features
from gesture_bot.speech.voice import load_voice

BALANCE = Path(__file__).parents[2] / "shared/data/balance_corpus/trials.npz"
with_balance = pytest.mark.skipif(not BALANCE.exists(), reason="../shared/data/balance_corpus is not here")

SENTENCES = (
    "The old miller sold his horse, his cart and both of his geese in a single afternoon.",
    "Nobody believed her until the water came through the ceiling of the town hall.",
    "You need three eggs, a spoon of honey, and as much flour as the bowl will hold.",
)


@pytest.fixture(scope="module")
def samples() -> np.ndarray:
    """Sentences with silence after each."""
    voice = load_voice("embedded")
    silence = np.zeros(SAMPLE_RATE, np.float32)
    return np.concatenate([part for text in SENTENCES for part in (voice.speak(text).samples, silence)])


@pytest.fixture(scope="module")
def ours(samples) -> np.ndarray:
    return speech_features(samples)


def as_another_would(ours: np.ndarray, repeat: int = 1) -> Sound:
    """Features at a multiple of our rate, with other units and gain, and some noise where it is silent."""
    generator = np.random.default_rng(1)
    static = np.repeat(ours[:, :STATIC].astype(np.float64), repeat, axis=0)
    mfcc = 0.23 * static[:, :COEFFICIENTS] + np.arange(COEFFICIENTS)
    power = 7 * 10 ** (static[:, COEFFICIENTS] / 10)
    noise = generator.normal(size=mfcc.shape) * (static[:, [COEFFICIENTS]] <= LEAST_SPEECH)
    return Sound(mfcc + noise, power * generator.uniform(0.99, 1.01, len(power)), 15 * repeat)


@pytest.mark.parametrize("repeat", [1, 2])
def test_features_of_another_kind_become_like_ours(ours, repeat):
    (made,) = features_like_ours([as_another_would(ours, repeat)])
    assert made.shape == ours.shape
    assert made.dtype == np.float32
    spoken = made[:, COEFFICIENTS] > LEAST_SPEECH
    for mine, theirs in zip(ours[spoken, :STATIC].T, made[spoken, :STATIC].T, strict=True):
        assert np.corrcoef(mine, theirs)[0, 1] > 0.999
        # One voice in three sentences is not all speech: about the same place and size.
        assert abs(mine.mean() - theirs.mean()) < mine.std()
        assert 0.5 < theirs.std() / mine.std() < 2
    np.testing.assert_allclose(made[1:, STATIC:], np.diff(made[:, :STATIC], axis=0), atol=1e-3)


def test_silence_of_another_kind_becomes_our_silence(ours):
    (made,) = features_like_ours([as_another_would(ours)])
    silent = ours[:, COEFFICIENTS] <= -59
    assert silent.sum() > 30
    assert (made[silent, :STATIC] == SILENCE_FEATURES[:STATIC]).all()
    loud = ours[:, COEFFICIENTS] > -35
    assert (made[loud, COEFFICIENTS] > LEAST_SPEECH).all()


def lsg21_body(keypoints: np.ndarray, hands_apart: bool) -> np.ndarray:
    """(n, 17, 3) keypoints as LSG21 stores them, (n, 165): by joint names, seen by a camera."""
    body = np.zeros((len(keypoints), len(lsg21_reader.JOINTS), 3))
    for place, joint in enumerate(lsg21_reader.JOINTS):
        side, _, part = joint.partition("_")
        name = {"hand_root": f"{side}_wrist", "index_0": f"{side}_index", "little_0": f"{side}_little"}.get(
            part, joint
        )
        if name in KEYPOINTS:
            x, y, z = np.moveaxis(keypoints[:, INDEX[name]], -1, 0)
            body[:, place] = np.stack([y, -z, -x], axis=-1)
    if hands_apart:
        for side in ("right", "left"):
            root = lsg21_reader.JOINTS.index(f"{side}_hand_root")
            body[:, root : root + 21] -= body[:, [root]].copy()
    return body.swapaxes(1, 2).reshape(len(keypoints), -1).astype(np.float32)


@pytest.fixture(scope="module")
def clips() -> np.ndarray:
    generator = np.random.default_rng(3)
    return np.stack([motion(generator, 64, 0.2, 5.0) for _ in range(3)])


@pytest.mark.parametrize("hands_apart", [False, True])
def test_lsg21_gives_the_keypoints_that_it_was_made_from(clips, samples, tmp_path, hands_apart):
    path = tmp_path / "train_oliver_noduplication_data.npz"
    wav = np.stack([samples[start:][:68267] for start in (0, 50_000, 100_000)])
    np.savez(path, body=np.stack([lsg21_body(clip, hands_apart) for clip in clips]), wav=wav)
    takes = list(lsg21_reader.read(path))
    skeleton = load_skeleton("lsg21")
    assert len(takes) == 3
    assert skeleton.labels(path.stem) == {"speaker": "oliver"}
    for take, clip, heard in zip(takes, clips, wav, strict=True):
        np.testing.assert_allclose(skeleton.keypoints(take), clip, atol=1e-6)
        np.testing.assert_allclose(take.features[:64], speech_features(heard)[:64], atol=0.1)


def test_lsg21_becomes_a_database_by_sound_of_whole_numbers_or_by_mfcc(clips, samples, ours, tmp_path):
    body = np.stack([lsg21_body(clip, True) for clip in clips])
    wav = np.stack([samples[start:][:68267] for start in (0, 50_000, 100_000)])
    np.savez(tmp_path / "train_seth_data.npz", body=body, wav=(wav * 32767).astype(np.int16))
    static = np.stack([speech_features(heard)[:64, :STATIC] for heard in wav])
    static[..., COEFFICIENTS] = np.log1p(1e6 * 10 ** (static[..., COEFFICIENTS] / 10))
    mfcc = np.concatenate([static, np.zeros_like(static)], axis=2)
    np.savez(tmp_path / "train_jon_data.npz", body=body, mfcc=mfcc)
    for speaker in ("seth", "jon"):
        output = tmp_path / f"{speaker}.safetensors"
        source = str(tmp_path / f"train_{speaker}_data.npz")
        assert main(["build-database", source, "-o", str(output), "--workers", "1"]) == 0
        database = Database.load(output)
        assert len(database.starts) == 3
        assert database.names["speaker"] == (speaker,)
        for start, clip in zip(database.starts, clips, strict=True):
            np.testing.assert_allclose(database.keypoints[start:][:64], clip, atol=0.02)
        energy = database.features[:, COEFFICIENTS]
        assert 0.3 < (energy > LEAST_SPEECH).mean() < 0.95


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"body": np.zeros((2, 64, 126)), "wav": np.zeros((2, 68267))}, "shape of body"),
        ({"body": np.zeros((2, 64, 165)), "wav": np.zeros((3, 68267))}, "shape of wav"),
        ({"body": np.zeros((2, 64, 165)), "mfcc": np.zeros((2, 64, 13))}, "shape of mfcc"),
        ({"body": np.zeros((2, 64, 165))}, "the array mfcc of"),
    ],
)
def test_an_lsg21_file_that_does_not_fit_is_named(tmp_path, arrays, message):
    path = tmp_path / "a.npz"
    np.savez(path, **arrays)
    assert lsg21_reader.fits(path)
    with pytest.raises(FileFormatError, match=message) as raised:
        list(lsg21_reader.read(path))
    assert str(path) in str(raised.value)


def test_a_damaged_lsg21_file_is_an_error_in_one_line(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, body=np.ones((2, 64, 165)), wav=np.zeros((2, 68267)))
    content = bytearray(path.read_bytes())
    content[2000] ^= 255
    path.write_bytes(content)
    with pytest.raises(FileFormatError, match="cannot read the array body"):
        list(lsg21_reader.read(path))


def test_one_clip_that_cannot_be_used_does_not_cost_the_others(clips, samples, tmp_path, capsys):
    body = np.stack([lsg21_body(clip, True) for clip in clips])
    body[0] = np.nan
    lying = body[1].reshape(64, 3, -1)
    lying[:, [0, 1]] = lying[:, [1, 0]]
    np.savez(tmp_path / "train_seth_data.npz", body=body, wav=np.stack([samples[:68267]] * 3))
    output = tmp_path / "own.safetensors"
    assert main(["build-database", str(tmp_path), "-o", str(output), "--workers", "1"]) == 0
    assert "192 frames read, 0 mended, 64 kept; cut: 128 unusable" in capsys.readouterr().out
    np.testing.assert_allclose(Database.load(output).keypoints[:64], clips[2], atol=0.02)


def test_a_damaged_archive_is_named_or_is_none(clips, tmp_path):
    path = tmp_path / "a.npz"
    np.savez_compressed(path, body=np.stack([lsg21_body(clip, True) for clip in clips]), wav=np.zeros((3, 9)))
    content = path.read_bytes()
    path.write_bytes(content[:1000] + b"\xff" * 500 + content[1500:])
    with pytest.raises(FileFormatError, match="cannot read the array body"):
        list(lsg21_reader.read(path))
    path.write_bytes(content[-30:])
    assert not lsg21_reader.fits(path)


def landmark_file(path: Path, **changes: np.ndarray) -> Path:
    """Two trials of somebody who holds still, but for what is changed."""
    arrays = {
        "names": np.array(["LEFT_ELBOW", "LEFT_WRIST", "RIGHT_ELBOW", "RIGHT_WRIST"]),
        "audio_names": np.array([*(f"mfcc{number}" for number in range(1, 14)), "rms", "f0"]),
        "fps": np.array(30),
    }
    for trial in ("1_a", "1_b"):
        arrays[f"{trial}/landmarks"] = np.random.default_rng(0).uniform(0.5, 1, (90, 4, 4))
        arrays[f"{trial}/audio"] = np.random.default_rng(0).uniform(0.1, 1, (90, 15))
    np.savez(path, **{**arrays, **changes})
    return path


def test_a_landmark_that_is_not_seen_is_lost(tmp_path):
    landmarks = np.random.default_rng(0).uniform(0.5, 1, (90, 4, 4))
    landmarks[10:20, 1, 3] = 0.2
    landmarks[30, 2] = np.nan
    takes = list(landmarks_reader.read(landmark_file(tmp_path / "a.npz", **{"1_a/landmarks": landmarks})))
    lost = np.isnan(takes[0].positions).all(axis=2)
    assert [take.name for take in takes] == ["1_a", "1_b"]
    assert np.argwhere(lost).tolist() == [*([frame, 1] for frame in range(10, 20)), [30, 2]]
    np.testing.assert_allclose(takes[0].positions[0, :, 0], landmarks[0, :, 0] * 16 / 9)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"1_a/audio": np.ones((80, 15))}, "shapes of 1_a"),
        (
            {"audio_names": np.array([f"band{number}" for number in range(15)])},
            "audio_names lacks.*rms.*band0",
        ),
        (
            {"names": np.array(["NOSE", "LEFT_WRIST", "RIGHT_ELBOW", "RIGHT_WRIST"])},
            "'LEFT_ELBOW'; valid: NOSE",
        ),
        ({"fps": np.array(0)}, "fps is no rate: 0"),
    ],
)
def test_a_landmark_file_that_does_not_fit_is_named(tmp_path, changes, message):
    with pytest.raises(FileFormatError, match=message):
        list(landmarks_reader.read(landmark_file(tmp_path / "a.npz", **changes)))


def test_arrays_of_another_kind_are_no_recordings(tmp_path):
    np.savez(tmp_path / "other.npz", names=np.zeros(3), table=np.zeros((3, 4)))
    (tmp_path / "text.npz").write_text("not a zip file")
    for reader in (lsg21_reader, landmarks_reader):
        assert not reader.fits(tmp_path / "other.npz")
        assert not reader.fits(tmp_path / "text.npz")


@with_balance
def test_people_seen_by_a_camera_become_upright_bodies_that_face_forward(tmp_path):
    output = tmp_path / "balance.safetensors"
    assert main(["build-database", str(BALANCE), "-o", str(output), "--workers", "1"]) == 0
    database = Database.load(output)
    keypoints = database.keypoints
    assert len(database.starts) > 150
    place = {name: keypoints[:, INDEX[name]] for name in KEYPOINTS}
    assert (place["left_shoulder"][:, 1] > place["right_shoulder"][:, 1] + 0.1).all()
    assert (place["neck"][:, 2] > 0.35).all()
    assert np.ptp(bone_lengths(keypoints), axis=0).max() < 1e-3
    # Hands are used in front of the body, and hang down at its sides.
    for side in ("left", "right"):
        x, y, z = place[f"{side}_wrist"].T
        assert 0.1 < np.median(x) < 0.4
        assert (x > -0.15).mean() > 0.98
        assert np.percentile(z, 5) < 0.0 < 0.25 < np.percentile(z, 85)
        assert np.median(y if side == "left" else -y) > 0.1
    # Depth is a guess, and may not shake more than what is seen.
    shake = np.sqrt(
        (np.diff(keypoints[:, [INDEX["left_wrist"], INDEX["right_wrist"]]], 2, axis=0) ** 2).mean((0, 1))
    )
    assert shake[0] < max(shake[1:])
    # They take turns with somebody: most of the time is silence.
    assert 0.15 < (database.features[:, COEFFICIENTS] > LEAST_SPEECH).mean() < 0.45
