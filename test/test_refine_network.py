"""The refinement network: trained on a tiny database, written, read, and run as windows come."""

import csv
import itertools
import sys
import time
from dataclasses import replace

import numpy as np
import onnx
import pytest
import torch
from conftest import wait_until
from moving_robot import spun
from rclpy.parameter import Parameter
from small_database import small_database

from gesture_bot.base.errors import FileFormatError, InvalidValueError, TrainingError
from gesture_bot.base.frames import WINDOW, KeypointClip, first_frame_after, frame_time
from gesture_bot.base.keypoints import bone_lengths, with_bone_lengths
from gesture_bot.cli.main import main
from gesture_bot.corpus.demo import load_database
from gesture_bot.evaluate.held_out import distances
from gesture_bot.matching.controls import Constraint
from gesture_bot.matching.hearing import Hearing
from gesture_bot.matching.quantities import MEASURES
from gesture_bot.msg import GestureWindow, SpeechFeatures
from gesture_bot.nodes.constraints import constraint_to
from gesture_bot.nodes.gesture_refiner import GestureRefiner
from gesture_bot.nodes.messages import clip_from, clip_to
from gesture_bot.nodes.node import PLAN, STREAM, stamp
from gesture_bot.refine import gan
from gesture_bot.refine import training as loop
from gesture_bot.refine.bounds import bounds_of
from gesture_bot.refine.missed import Missed
from gesture_bot.refine.model import NONE, SHIPPED, RefinementModel, load_model
from gesture_bot.refine.networks import CONTROLS, GESTURE, Generator
from gesture_bot.refine.pairs import held_out, walks
from gesture_bot.refine.smoothing import RADIUS, WindowJoiner, WindowSmoother
from gesture_bot.refine.streaming import NetworkRefiner, refined_motion
from gesture_bot.refine.training import Settings, Training

ITERATIONS = 30


SETTINGS = Settings("steered", width=1 / 32, batch=4, report_every=10, test_every=10)


def training(database, output, settings=SETTINGS):
    return Training(database, database, output, settings, distances)


@pytest.fixture(scope="module")
def database():
    return small_database(recordings=6)


@pytest.fixture(scope="module")
def trained(database, tmp_path_factory):
    """The model file of a training that nothing interrupted."""
    output = tmp_path_factory.mktemp("trained") / "model.onnx"
    training(database, output).run(ITERATIONS)
    return output


@pytest.fixture(scope="module")
def model(trained, database):
    return load_model(str(trained), database)


@pytest.fixture(scope="module")
def found(database):
    return walks(database, database, held_out(database, seed=3), seed=3)


def test_pairs_are_from_another_recording_and_none_that_is_held_out(database, found):
    held = held_out(database, seed=3)
    assert [walk.recording for walk in found] == list(range(6))
    for walk in found:
        assert set(database.recording[walk.sequences]).isdisjoint([walk.recording, *held])
        assert len(walk.sequences) > 4
        real = database.keypoints[walk.rows]
        for one in walk.joined:
            assert np.linalg.norm(one - real, axis=-1).mean() > 0.02
        assert np.linalg.norm(walk.joined[0] - walk.joined[1], axis=-1).mean() > 0.02
        # Joined, they do not jump.
        steps = np.linalg.norm(np.diff(walk.joined, axis=1)[:, :, 9], axis=-1)
        assert steps.max() < 3 * np.linalg.norm(np.diff(real, axis=0)[:, 9], axis=-1).max()


def test_controls_are_kept_by_what_is_real_and_by_what_is_found(database, found):
    bounds = np.concatenate([walk.bounds for walk in found])
    asked = np.isfinite(bounds)
    assert 0.2 < asked.any(axis=1).mean() < 1

    def kept(motions):
        least, most = np.split(bounds, 2, axis=1)
        values = np.concatenate(
            [np.concatenate([of(one) for of in MEASURES.values()], axis=1) for one in motions]
        )
        return np.concatenate([values >= least - 1e-6, values <= most + 1e-6], axis=1)[asked].mean()

    real, free, steered = (
        kept(motions)
        for motions in (
            [database.keypoints[walk.rows].astype(np.float64) for walk in found],
            *([walk.joined[kind] for walk in found] for kind in (0, 2)),
        )
    )
    assert real > 0.75  # but for 5 % of each stretch, where bounds change, and what gave way
    assert steered > free + 0.1


def test_training_moves_the_losses(trained):
    rows = list(csv.DictReader(trained.with_suffix(".csv").open()))
    assert [int(row["iteration"]) for row in rows] == list(range(0, ITERATIONS + 1, 10))
    penalty, change = (np.array([float(row[name]) for row in rows[1:]]) for name in ("penalty", "change"))
    assert penalty[-1] < penalty[0]
    assert change[-1] > 1.5 * change[0] > 0
    for name in ("FGD", "kinematic FD"):
        assert len({float(row[name]) for row in rows}) == len(rows)
    assert trained.with_suffix(".png").stat().st_size > 10_000


def test_a_killed_training_goes_on_as_if_nothing_had_happened(trained, database, tmp_path, monkeypatch):
    def killed(self, iteration, step=gan.Gan.step):
        if iteration == 25:
            raise KeyboardInterrupt
        return step(self, iteration)

    output = tmp_path / "model.onnx"
    with monkeypatch.context() as patch:
        patch.setattr(gan.Gan, "step", killed)
        patch.setattr(loop, "SAVE_EVERY", 0.0)
        with pytest.raises(KeyboardInterrupt):
            training(database, output).run(ITERATIONS)
    again = training(database, output)
    assert again.iteration == 20
    again.run(ITERATIONS)

    assert output.with_suffix(".csv").read_text() == trained.with_suffix(".csv").read_text()
    ours, theirs = (torch.load(path.with_suffix(".pt"))["networks"] for path in (output, trained))
    for network in ("generator", "critic", "averaged"):
        for name, tensor in theirs[network].items():
            assert torch.equal(ours[network][name], tensor), name
    assert output.read_bytes() == trained.read_bytes()


def test_a_checkpoint_of_another_training_is_refused(trained, database):
    with pytest.raises(InvalidValueError, match="whose width was 0.03125.* now: 0.5"):
        training(database, trained, replace(SETTINGS, width=0.5))


def test_divergence_ends_the_training_and_keeps_the_checkpoint(database, tmp_path, monkeypatch):
    output = tmp_path / "model.onnx"
    training(database, output).run(10)
    checkpoint = output.with_suffix(".pt").read_bytes()
    monkeypatch.setitem(gan.RECIPES, "steered", replace(gan.RECIPES["steered"], penalty=1e12))
    with pytest.raises(TrainingError, match="diverged in iteration 11: .*model.pt holds iteration 10"):
        training(database, output).run(20)
    assert output.with_suffix(".pt").read_bytes() == checkpoint


def test_the_file_gives_what_the_network_gave(trained, model):
    saved = torch.load(trained.with_suffix(".pt"))["best"]
    assert model.card.training["iteration"] == saved["iteration"]
    generator = Generator(SETTINGS.width, controls=True)
    generator.load_state_dict(saved["generator"])
    heard, found = torch.randn(7, 28 + CONTROLS, 64), torch.randn(7, GESTURE, 64)
    with torch.no_grad():
        expected = generator.eval()(heard, found).numpy()
    assert np.abs(expected - found.numpy()).max() > 1e-3
    np.testing.assert_allclose(model.run(heard.numpy(), found.numpy()), expected, atol=1e-4)


def test_what_is_shown_is_known_when_its_window_is(model):
    """No frame depends on what comes after its window of 8."""
    random = np.random.default_rng(0)
    heard, found = (random.normal(size=(1, n, 64)).astype(np.float32) for n in (28 + CONTROLS, GESTURE))
    before = model.run(heard, found)
    heard[..., 40:], found[..., 40:] = 0, 0
    after = model.run(heard, found)
    np.testing.assert_allclose(after[..., :40], before[..., :40], atol=1e-5)
    assert np.abs(after[..., 40:] - before[..., 40:]).max() > 1e-3


def test_what_gestures_miss_is_measured_as_the_controls_measure_it(model, database):
    keypoints = database.keypoints[:64].astype(np.float64)
    expected = np.concatenate([of(keypoints) for of in MEASURES.values()], axis=1)
    missed = Missed(model.card)
    gesture = torch.from_numpy(model.card.gesture_in(keypoints))[None]
    np.testing.assert_allclose(missed.measured(gesture)[0].T, expected, atol=1e-4)
    bounds = np.full((64, 16), np.nan)
    bounds[:32, 1] = expected[:32, 1] + 0.05  # the right wrist at least 5 cm higher
    bounds[:, 8] = expected[:, 0] + 0.01  # the left one no higher than a little over where it is
    controls = torch.from_numpy(model.card.heard_in(database.features[:64], bounds)[28:])[None]
    share = 0.05 / model.card.quantity_deviation[1] * 32 / 96
    assert missed(gesture, controls).item() == pytest.approx(share, rel=1e-3)
    assert missed(gesture, torch.zeros_like(controls)).item() == 0


def test_models_that_do_not_fit_are_refused_with_the_reason(trained, database, tmp_path):
    other = small_database(seed=5, recordings=6)
    with pytest.raises(FileFormatError, match="trained for another database .*differs by .* deviations"):
        load_model(str(trained), other)
    with pytest.raises(FileFormatError, match="no such file"):
        RefinementModel(tmp_path / "none.onnx")
    broken, foreign = tmp_path / "broken.onnx", tmp_path / "foreign.onnx"
    broken.write_bytes(trained.read_bytes()[:1000])
    with pytest.raises(FileFormatError, match=r"cannot read .*broken\.onnx as a model"):
        RefinementModel(broken)
    stripped = onnx.load(trained)
    del stripped.metadata_props[:]
    onnx.save(stripped, foreign)
    with pytest.raises(FileFormatError, match="is an ONNX file, but no gesture_bot model"):
        RefinementModel(foreign)


def streamed(model, database, features, clips, sources, kept=()):
    """What a listener ends up with, by frame."""
    hearing = Hearing(database)
    for frame, feature in enumerate(features):
        hearing.add_features(frame, feature, True)
    heard = hearing.features(0, len(features))
    refiner, frames = NetworkRefiner(model, hearing), {}
    for clip, source in zip(clips, sources, strict=False):
        refined = refiner.push(clip, source, kept)
        assert (refined.start, refined.stop) == (max(0, clip.start - RADIUS), clip.stop)
        frames.update(enumerate(refined.keypoints, refined.start))
    return heard, np.array([frames[frame] for frame in sorted(frames)])


def test_streaming_is_the_offline_result_away_from_the_edges(model, database):
    found = database.keypoints[np.random.default_rng(0).integers(0, 1000, 24)[:, None] + np.arange(WINDOW)]
    clips = [KeypointClip(WINDOW * number, window) for number, window in enumerate(found)]
    found = found.reshape(-1, 17, 3)
    features = database.features[: len(found)]
    kept = [Constraint("wrist_height", "at_least", 3.0, "left", "value")]
    heard, seen = streamed(model, database, features, clips, itertools.repeat("speech"), kept)
    bounds = np.tile(bounds_of(kept), (len(found), 1))
    joiner, joined = WindowJoiner(), []
    for clip in clips:
        joiner.push(clip)
        joined.append(with_bone_lengths(joiner.motion[-WINDOW:], joiner.lengths[-WINDOW:]))
    offline = refined_motion(model.refined, heard, np.concatenate(joined), bounds)
    free = refined_motion(model.refined, heard, np.concatenate(joined), np.full_like(bounds, np.nan))
    assert np.abs(offline - free).max() > 1e-5
    inside = slice(WINDOW, -RADIUS)  # where the network has taken over, and the future is known
    np.testing.assert_allclose(seen[inside], offline[inside], atol=1e-6)
    assert np.abs(offline - found).max() > 1e-5
    np.testing.assert_allclose(bone_lengths(seen), bone_lengths(found), atol=1e-6)


def test_rest_and_semantic_gestures_are_smoothed_alone(model, database):
    clips = [KeypointClip(32 * number, database.keypoints[32 * number :][:32]) for number in range(4)]
    _, seen = streamed(model, database, database.features[:128], clips, ["speech", "bank", "speech", "rest"])
    smoother, smooth = WindowSmoother(), {}
    for clip in clips:
        refined = smoother.push(clip)
        smooth.update(enumerate(refined.keypoints, refined.start))
    apart = np.abs(seen - np.array([smooth[frame] for frame in range(128)])).max(axis=(1, 2))
    assert apart[40:64].max() == pytest.approx(0, abs=1e-9) == apart[104:].max()
    assert apart[8:32].max() > 1e-3 < apart[72:96].max()


@pytest.mark.parametrize("recipe", ["paper", "light"])
def test_the_other_recipes_train_too_and_see_no_controls(database, tmp_path, recipe):
    other = training(database, tmp_path / "model.onnx", replace(SETTINGS, recipe=recipe))
    other.run(10)
    assert other.rows[-1]["change"] > 0
    model = load_model(str(tmp_path / "model.onnx"), database)
    keypoints, features = database.keypoints[None, :64], database.features[None, :64]
    free, bound = (model.refined(features, keypoints, np.full((1, 64, 16), bound)) for bound in (np.nan, 0.5))
    np.testing.assert_array_equal(free, bound)


def test_the_shipped_network_is_used_where_it_fits(database):
    assert load_model(SHIPPED, load_database("demo")).card.controls
    assert load_model(SHIPPED, database) is None
    assert load_model(NONE, load_database("demo")) is None


def test_without_torch_the_command_says_what_to_install(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "torch", None)
    assert main(["train", "demo", "-o", "model.onnx"]) == 1
    assert capsys.readouterr().err == ("gesture-bot: torch missing; try: pip install 'gesture-bot[train]'\n")


@pytest.mark.parametrize("fits", [True, False])
def test_the_node_refines_by_the_network_or_says_why_it_smooths(trained, database, tmp_path, listener, fits):
    used = database if fits else small_database(seed=5, recordings=6)
    used.save(tmp_path / "database.safetensors")
    values = {"model": str(trained), "database": str(tmp_path / "database.safetensors")}
    kept = [Constraint("hand_span", "at_most", 0.25, unit="value")]
    overrides = [Parameter(name, value=value) for name, value in values.items()]
    node = GestureRefiner(context=listener.context, parameter_overrides=overrides)
    start = first_frame_after(listener.now() + 2.0)
    clips = [KeypointClip(start + WINDOW * n, used.keypoints[WINDOW * n :][:WINDOW]) for n in range(4)]
    hearing = Hearing(used)
    with spun(listener.context, [node]):
        features = listener.create_publisher(SpeechFeatures, "speech/features", STREAM)
        windows = listener.create_publisher(GestureWindow, "gesture/selected", PLAN)
        wait_until(windows.get_subscription_count, 10, "the refiner")
        wait_until(lambda: listener.count_publishers("gesture/refined"), 10, "its publisher")
        wait_until(lambda: features.get_subscription_count() == 1 + fits, 10, "whether it listens to speech")
        for frame in range(start, clips[-1].stop):
            message = SpeechFeatures(features=used.features[frame - start], speech=True)
            message.header.stamp = stamp(frame_time(frame))
            features.publish(message)
            hearing.add_features(frame, used.features[frame - start], True)
            time.sleep(0.002)
        time.sleep(0.2)
        for clip in clips:
            message = clip_to(clip, "speech")
            message.kept = [constraint_to(constraint) for constraint in kept]
            windows.publish(message)
        wait_until(lambda: len(listener.record.refined) == len(clips), 10, "refined windows")
        listener.record.diagnostics.clear()
        wait_until(lambda: listener.record.diagnostics, 5, "how the refiner is")
    smoother, network = WindowSmoother(), NetworkRefiner(RefinementModel(trained), hearing)
    for heard, clip in zip(listener.record.refined, clips, strict=True):
        expected = network.push(clip, "speech", kept) if fits else smoother.push(clip)
        np.testing.assert_allclose(clip_from(heard.message).keypoints, expected.keypoints, atol=1e-6)
    (status,) = listener.record.diagnostics[-1].message.status
    told = {value.key: value.value for value in status.values}
    assert told["refined_by"] == ("network" if fits else "smoothing")
    assert ("trained for another database" in status.message) != fits
