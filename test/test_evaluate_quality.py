"""`gesture-bot evaluate quality`: each metric on a case with a known answer, and the table as a whole."""

import csv
import hashlib
import sys
from dataclasses import replace

import numpy as np
import pytest
import soundfile
from small_database import motion, small_database

from gesture_bot.base.errors import FileFormatError, GestureBotError, InvalidValueError
from gesture_bot.cli.main import main
from gesture_bot.corpus.movement import minimum_jerk
from gesture_bot.corpus.one_body import STANDARD, STANDARD_LENGTHS
from gesture_bot.evaluate import resampling
from gesture_bot.evaluate.beat_scores import BEAT_CONSISTENCY, SIGMA, pmb
from gesture_bot.evaluate.bone_error import BONE_ERROR
from gesture_bot.evaluate.encoder import LATENTS, Encoder, fgd
from gesture_bot.evaluate.frechet import frechet_distance, half_distance, half_sums
from gesture_bot.evaluate.held_out import distances
from gesture_bot.evaluate.kinematics import KINEMATIC_DISTANCE
from gesture_bot.evaluate.lexicon import entropy, lexemes, lexicon
from gesture_bot.evaluate.motion_files import write_bvh
from gesture_bot.evaluate.pieces import Motion, Performance, Piece, mismatched, pieces_of
from gesture_bot.evaluate.position_errors import MAD, MAJE
from gesture_bot.evaluate.quality import quality_table
from gesture_bot.evaluate.quality_files import differs, quality_lines
from gesture_bot.evaluate.resampling import Metric, estimate, ratio
from gesture_bot.evaluate.seams import evenness
from gesture_bot.evaluate.systems import SMOOTHED
from gesture_bot.evaluate.windows import parent_relative
from gesture_bot.matching.rhythm import motion_beats
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.voice import load_voice

WRISTS = [9, 14]
NO_SEAMS = np.zeros(0, int)


def piece(shown, recorded=None, seams=NO_SEAMS, beats=None):
    return Piece(shown, shown if recorded is None else recorded, np.asarray(seams), beats)


def value(metric, *pieces):
    return float(metric.value(metric.sums(pieces).sum(axis=0)))


@pytest.fixture(scope="module")
def moved():
    """Keypoints of eight recordings of 10 s."""
    generator = np.random.default_rng(5)
    return [motion(generator, 150, 0.2, 5.0) for _ in range(8)]


def test_an_offset_is_an_error_of_place_and_none_of_acceleration(moved):
    shifted = moved[0] + [0.01, -0.02, 0.03]
    assert value(MAJE, piece(shifted, moved[0])) == pytest.approx(20)
    assert value(MAD, piece(shifted, moved[0])) == pytest.approx(0, abs=1e-6)
    time = np.arange(150)[:, None, None] / 15
    assert value(MAD, piece(moved[0] + time**2 / 2 * [0.3, 0, 0.4], moved[0])) == pytest.approx(500)
    assert value(MAJE, piece(moved[0])) == value(MAD, piece(moved[0])) == 0


def test_the_distance_of_gaussians_is_the_closed_form():
    generator = np.random.default_rng(0)
    turned, _ = np.linalg.qr(generator.normal(size=(3, 3)))
    narrow, wide = (turned * np.square([1, 2, 3])) @ turned.T, (turned * np.square([2, 2, 7])) @ turned.T
    mean = np.array([1.0, -2.0, 0.5])
    distance = frechet_distance(mean, narrow, mean + [3, 0, 4], wide)
    assert distance == pytest.approx(25 + 1 + 0 + 16)
    assert frechet_distance(mean, wide, mean, wide) == pytest.approx(0, abs=1e-12)

    halves = [generator.normal(size=(40, 3))] * 2
    sums = half_sums([half + [0, 2, 0] for half in halves], halves).sum(axis=0)
    assert half_distance(3)(sums) == pytest.approx(4)


@pytest.mark.parametrize("metric", [fgd(Encoder()), KINEMATIC_DISTANCE], ids=lambda metric: metric.name)
def test_the_same_motion_is_at_no_distance_and_worse_motion_at_a_larger_one(moved, metric):
    halves = [one for one in moved[:4] for _ in range(2)]  # both halves hold the same
    assert value(metric, *map(piece, halves)) == pytest.approx(0, abs=1e-6)
    noise = np.random.default_rng(0).normal(0, 0.02, moved[0].shape)
    still = np.repeat(STANDARD[None], 150, axis=0)
    shaken, stiff = (
        [piece(shown(one), one) for one in halves] for shown in (lambda one: one + noise, lambda _: still)
    )
    assert value(metric, *stiff) > 0.1 and value(metric, *shaken) > 0.01


def test_beats_that_are_shifted_give_the_known_share():
    times = np.arange(300) / 15
    keypoints = np.zeros((300, 17, 3))
    for number in range(18):
        keypoints[:, WRISTS, 2] += (-1) ** number * 0.3 * minimum_jerk((times - number - 0.7) / 0.4)[:, None]
    moves = motion_beats(keypoints) / 15
    assert len(moves) == 18
    late = piece(keypoints, beats=moves + np.repeat([0.05, 0.15, 0.25], 6))
    assert value(pmb(0.1), late) == pytest.approx(100 / 3)
    assert value(pmb(0.2), late) == pytest.approx(200 / 3)
    near = np.exp(-(np.array([0.05, 0.15, 0.25]) ** 2) / (2 * SIGMA**2))
    assert value(BEAT_CONSISTENCY, late) == pytest.approx(near.mean())
    assert np.isnan(value(pmb(0.2), late, piece(keypoints)))  # of one, the sound is not there


def test_diversity_is_the_entropy_of_what_is_used(moved):
    np.testing.assert_allclose(entropy(np.array([[5, 5, 5, 5], [7, 0, 0, 0]])), [2, 0])
    centres = lexicon(small_database(recordings=12))
    assert len(centres) == 50
    still = lexemes(np.repeat(moved[0][:1], 80, axis=0), centres)
    assert still.max() == still.sum() == 10
    assert (lexemes(moved[0], centres) > 0).sum() > 3


def test_a_jump_at_a_seam_counts_there_alone():
    keypoints = np.zeros((60, 17, 3))
    keypoints[30:, WRISTS[0], 0] = 0.3  # of one wrist of two
    jump = piece(keypoints, seams=[10, 30])
    assert value(evenness(3, "inside"), jump) == value(evenness(2, "inside"), jump) == 0
    assert value(evenness(2, "at seams"), jump) == pytest.approx(0.3 * (1 + 1) * 15**2 / 2 / 4)
    assert value(evenness(3, "at seams"), jump) == pytest.approx(0.3 * (1 + 2 + 1) * 15**3 / 2 / 6)
    assert value(evenness(3, "inside"), piece(keypoints)) > 0
    assert np.isnan(value(evenness(3, "at seams"), piece(keypoints)))


def test_a_body_that_is_too_large_has_wrong_bones(moved):
    assert value(BONE_ERROR, piece(moved[0])) == pytest.approx(0, abs=1e-6)
    assert value(BONE_ERROR, piece(1.1 * moved[0])) == pytest.approx(100 * STANDARD_LENGTHS.mean())


def test_the_interval_of_a_mean_is_the_known_one_and_systems_are_compared_pair_by_pair():
    generator = np.random.default_rng(0)
    means = generator.normal(3, 2, 200)
    pieces = [piece(np.full((1, 17, 3), mean)) for mean in means]

    def mean_of(offset):
        return Metric(
            "", "", lambda some: np.array([(one.shown[0, 0, 0] + offset, 1) for one in some]), ratio, 1
        )

    one, better = estimate(mean_of(0), pieces), estimate(mean_of(-0.01), pieces)
    low, high = one.interval
    assert one.value == pytest.approx(means.mean())
    assert (high - low) / 2 == pytest.approx(1.96 * means.std() / 200**0.5, rel=0.1)
    assert low < one.value < high
    assert better.minus(one).interval == pytest.approx((-0.01, -0.01), rel=0.01)


def performances(moved, features):
    speech = np.arange(150) < 120
    return [Performance(f"{place}", features, speech, one, None) for place, one in enumerate(moved)]


def test_pieces_are_of_five_seconds_or_whole_and_mismatched_within_their_half(moved):
    said = performances(moved, np.zeros((150, 28), np.float32))
    pieces = pieces_of(said, [Motion(one.recorded, np.array([0, 70, 80])) for one in said])
    assert [len(one.shown) for one in pieces] == [75] * 16
    assert [list(one.seams) for one in pieces[:2]] == [[70], [5]]
    whole = pieces_of(said + said, [Motion(one.recorded) for one in said + said])
    assert [len(one.shown) for one in whole] == [150] * 16
    for place, one in enumerate(mismatched(pieces)):
        (own,) = (
            other for other, theirs in enumerate(pieces) if np.shares_memory(one.shown, theirs.recorded)
        )
        assert own != place and own % 2 == place % 2
    with pytest.raises(InvalidValueError, match="too little"):
        pieces_of(said[:1], [Motion(said[0].recorded)])


@pytest.fixture
def few_draws(monkeypatch):
    monkeypatch.setattr(resampling, "RESAMPLES", 50)


class Still:
    """A network that holds a pose."""

    def refined(self, features, keypoints, bounds):
        return np.broadcast_to(STANDARD, keypoints.shape)


def test_the_table_has_a_row_for_each_system(moved, few_draws):
    database = small_database(recordings=12)
    said = performances(moved[:3], database.features[:150])
    quality = quality_table(database, said, Still())
    rows = {row.system: row for row in quality.rows}
    assert len(rows) == 7 and quality.pieces == 6 and quality.minutes == pytest.approx(1 / 2)
    recorded, mismatched_motion = quality.rows[:2]
    figures = {
        name: {metric: one.value for metric, one in row.estimates.items()} for name, row in rows.items()
    }
    assert figures[recorded.system]["MAJE"] == 0 < figures[mismatched_motion.system]["MAJE"]
    found, smoothed, refined = (figures[name] for name in list(rows)[4:])
    assert found["jerk at seams"] > 2 * smoothed["jerk at seams"]
    assert found["bone error"] == pytest.approx(0, abs=1e-3)
    assert refined["jerk inside"] < smoothed["jerk inside"] / 2
    lines = {(line["system"], line["metric"]): line for line in quality_lines(quality)}
    assert lines[SMOOTHED, "FGD"]["difference"] == 0
    assert lines["k-NN pose pre-selected", "jerk at seams"]["difference_low"] > 0
    (jerk,) = (metric for metric in quality.metrics if metric.name == "jerk inside")
    assert differs(quality.rows[-1], jerk) and not differs(rows[SMOOTHED], jerk)


def test_motion_is_no_distance_from_itself_and_further_the_more_it_is_changed(moved):
    for name, value in distances(moved, moved).items():
        assert value == pytest.approx(0, abs=1e-6), name
    slower, still = ([STANDARD + share * (one - STANDARD) for one in moved] for share in (0.8, 0.2))
    near, far = distances(slower, moved), distances(still, moved)
    assert all(0 < 2 * near[name] < far[name] for name in near)


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """A BVH file with a sound beside it."""
    folder = tmp_path_factory.mktemp("recording")
    said = (
        load_voice("embedded")
        .speak("The cook counts the spoons, all of them, and the gardener the birds.")
        .samples
    )
    samples = np.tile(said, 10)[: 24 * SAMPLE_RATE]
    soundfile.write(folder / "talk.wav", samples, SAMPLE_RATE)
    write_bvh(folder / "talk.bvh", motion(np.random.default_rng(1), 24 * 15, 0.2, 4.0), 15)
    return folder / "talk.bvh"


def test_the_command_judges_recordings_and_writes(recording, few_draws, tmp_path, capsys):
    small_database(recordings=12).save(tmp_path / "small.safetensors")
    arguments = ["evaluate", "quality", "--database", str(tmp_path / "small.safetensors")]
    assert main([*arguments, "--speech", str(recording), "-o", str(tmp_path / "out")]) == 0
    printed = capsys.readouterr().out
    table = (tmp_path / "out/quality.md").read_text()
    assert table in printed
    lines = list(csv.DictReader((tmp_path / "out/quality.csv").open()))
    assert len(lines) == 6 * 13
    for line in lines:
        if line["metric"] == "PMB 0.1 s":
            assert 0 <= float(line["value"]) <= 100
            assert f"{float(line['value']):.1f} (" in table
    assert all((tmp_path / "out" / name).stat().st_size > 10_000 for name in ("quality.png", "pmb.png"))

    assert main(arguments) == 1
    assert "--speech" in capsys.readouterr().err


def test_a_recording_that_the_database_holds_is_refused(recording, tmp_path, capsys):
    database = small_database(recordings=12)
    digest = hashlib.blake2b(recording.read_bytes(), digest_size=16).hexdigest()
    held = replace(database, metadata={"sources": [{"digests": {"talk.bvh": digest}}]})
    held.save(tmp_path / "held.safetensors")
    arguments = ["--database", str(tmp_path / "held.safetensors"), "--speech", str(recording)]
    assert main(["evaluate", "quality", *arguments]) == 1
    assert "built from this recording" in capsys.readouterr().err


def test_an_encoder_is_trained_and_runs_without_torch_as_with_it(tmp_path, moved):
    import torch
    from safetensors.numpy import load_file

    from gesture_bot.evaluate.encoder_training import train_encoder

    path = tmp_path / "encoder.safetensors"
    about = train_encoder(small_database(recordings=6), path, steps=3)
    assert 0 < about["unseen_error_mm"] < 200
    arrays = {name: torch.tensor(array) for name, array in load_file(path).items()}
    hidden = (torch.tensor(parent_relative(moved[0][:32]), dtype=torch.float32) - arrays["mean"]) / arrays[
        "deviation"
    ]
    hidden = hidden.T[None]
    for layer in range(3):
        hidden = torch.nn.functional.conv1d(
            hidden, arrays[f"convolutions.{layer}.weight"], arrays[f"convolutions.{layer}.bias"], stride=2
        )
        hidden = torch.nn.functional.leaky_relu(hidden, 0.2)
    latent = arrays["linear.weight"] @ hidden[0].T.flatten() + arrays["linear.bias"]
    assert latent.shape == (LATENTS,)
    np.testing.assert_allclose(Encoder(path).latents(moved[0])[0], latent, atol=1e-4)


def test_without_torch_or_without_an_encoder_the_error_is_clear(tmp_path, monkeypatch):
    from gesture_bot.evaluate.encoder_training import train_encoder

    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(GestureBotError, match="needs torch"):
        train_encoder(small_database(recordings=6), tmp_path / "encoder.safetensors", steps=1)
    small_database(recordings=6).save(tmp_path / "database.safetensors")
    with pytest.raises(FileFormatError, match="encoder of gestures"):
        Encoder(tmp_path / "database.safetensors")
