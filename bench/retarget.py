"""How well robots of all kinds do what people do with their arms, beside two plain rivals.

`make bench-retarget`, or `python bench/retarget.py --motion FOLDER` with recordings of people as a second
block. toa, and each robot of test/installed_robots.py whose package is installed, with the mapping that
`gesture-bot robot add` proposes. The last line is one JSON object.

Whoever solves the frames, the same Retargeter plans the motion; only the rivals' angles are not smoothed.
Directions are those of upper arms and forearms, 50 times a second, the person's by cubic splines through the
keypoints. The baseline of all frames solves the same objective without limits or self-collision, and clips
the angles. Per-link inverse kinematics by ikpy takes 20 times as long, and solves three passages (`ikpy_`,
`beside_ikpy_`). Neither rival knows that the robot has a body; `without_body_` is our solver when it does not
know, either. On a robot, the safety envelope stops arms before they touch it: `sent_` is what leaves that.

Then robots are asked for random unit directions, each unrelated to the last. Counted are solved frames and
planned ticks of both parts that touch or leave limits, and touches in what leaves the safety envelope.
"""

import argparse
import json
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np
from machine import machine
from per_link_ik import PerLinkIK
from rich.console import Console
from rich.table import Table
from scipy.interpolate import CubicSpline
from scipy.signal import welch
from threadpoolctl import threadpool_limits
from tqdm import tqdm

from gesture_bot.base.errors import GestureBotError
from gesture_bot.base.files import config_dir
from gesture_bot.base.frames import FRAME_RATE, KeypointClip
from gesture_bot.base.trajectory import JointTrajectory
from gesture_bot.corpus.database import SEQUENCE, Database
from gesture_bot.corpus.demo import demo_database
from gesture_bot.corpus.readers import READERS, reader_of
from gesture_bot.corpus.skeletons import choose_skeleton, load_skeletons
from gesture_bot.corpus.takes import motion_of
from gesture_bot.retarget import retargeter
from gesture_bot.retarget.clearance import Clearance
from gesture_bot.retarget.directions import DIRECTIONS, directions
from gesture_bot.retarget.mapping_file import write_mapping
from gesture_bot.retarget.proposal import propose
from gesture_bot.retarget.reach import BONES, angle_between
from gesture_bot.retarget.retargeter import SMOOTHING, TICK_RATE, Retargeter
from gesture_bot.retarget.robot import Robot, load_robot, read_urdf
from gesture_bot.retarget.solver import DirectionSolver
from gesture_bot.servo.collision_guard import CollisionGuard
from gesture_bot.servo.envelope import Envelope

sys.path.insert(0, str(Path(__file__).parents[1] / "test"))
from installed_robots import URDFS  # noqa: E402  from test/

FRAMES = 600 * FRAME_RATE
"""Of a block at most (10 minutes)."""

FRAMES_OF_A_FILE = 180 * FRAME_RATE
"""Of recordings at most, so that one does not stand for all."""

ARRIVED = TICK_RATE
"""Ticks of a clip that are left out: the robot comes from its rest pose."""

BLOCK = 500
"""Random poses that are planned at once."""

SLACK = 1e-9
"""By so much rounding may break a limit [rad, rad/s, rad/s^2]."""

Solve = Callable[[np.ndarray, np.ndarray], np.ndarray]


class ClippedAngles:
    """The same objective without limits and self-collision; the angles are clipped afterwards."""

    def __init__(self, robot: Robot):
        self._limits = robot.limits
        endless = np.full(len(robot.joints), np.inf)
        limits = replace(robot.limits, lower=-endless, upper=endless)
        self._solver = without_body(replace(robot, limits=limits))
        self._angles = robot.rest

    def solve(self, targets: np.ndarray, previous: np.ndarray) -> np.ndarray:
        """Goes on from its own angles, before they were clipped."""
        self._angles = self._solver.solve(targets, self._angles)
        return np.clip(self._angles, self._limits.lower, self._limits.upper)


class Nothing:
    """Clearance of a robot that is never near itself."""

    def rows(self, limit: float) -> tuple[np.ndarray, np.ndarray]:
        """No distances, nor derivatives."""
        return np.empty(0), np.empty((0, 0))

    def under(self, angles: np.ndarray, limit: float) -> dict[int, float]:
        """No distances."""
        return {}


def without_body(robot: Robot) -> DirectionSolver:
    solver = DirectionSolver(robot)
    solver._clearance = Nothing()
    return solver


def at_the_bus(robot: Robot, plan: JointTrajectory) -> np.ndarray:
    """(n, j) angles that leave the safety envelope [rad]."""
    envelope = Envelope(robot.limits, 1 / TICK_RATE, robot.rest, CollisionGuard(robot, 1 / TICK_RATE))
    ticks = zip(plan.positions, plan.velocities, strict=True)
    return np.array([envelope.step(position, velocity) for position, velocity in ticks])


class Watched:
    """A solver whose poses are kept, and whose processor time [s] is taken."""

    def __init__(self, solve: Solve):
        self._solve = solve
        self.poses: list[np.ndarray] = []
        self.busy = 0.0

    def solve(self, targets: np.ndarray, previous: np.ndarray) -> np.ndarray:
        """What the watched one finds."""
        begin = time.thread_time()
        angles = self._solve(targets, previous)
        self.busy += time.thread_time() - begin
        self.poses.append(angles)
        return angles


def demo_clips() -> list[np.ndarray]:
    """The recordings of the demo corpus."""
    database = Database.load(demo_database())
    firsts = np.flatnonzero(np.diff(database.recording, prepend=-1))
    lasts = [*(firsts[1:] - 1), len(database.starts) - 1]
    return [
        database.keypoints[database.starts[first] : database.starts[last] + SEQUENCE]
        for first, last in zip(firsts, lasts, strict=True)
    ]


def recorded_clips(folder: Path) -> Iterator[np.ndarray]:
    """The stretches of people's motion in the files of a folder, brought into one body."""
    skeletons = list(load_skeletons().values())
    files = [path for path in sorted(folder.rglob("*")) if any(reader.fits(path) for reader in READERS)]
    for path in tqdm(files, "reading recordings", unit="file"):
        left = FRAMES_OF_A_FILE
        for take in reader_of(path).read(path):
            try:
                motion = motion_of(take, choose_skeleton(take, path.stem, skeletons))
            except GestureBotError as error:
                tqdm.write(f"{path} is left out: {error}")
                break
            for kept in motion.kept:
                first, stop = (round(edge / motion.rate * FRAME_RATE) for edge in (kept.start, kept.stop))
                clip = motion.keypoints[first : min(stop, first + left)]
                if len(clip) >= SEQUENCE:
                    left -= len(clip)
                    yield clip
            if left < SEQUENCE:
                break


def up_to(clips: Sequence[np.ndarray], frames: int) -> list[np.ndarray]:
    """The first clips, so many frames of them."""
    ends = np.cumsum([len(clip) for clip in clips])
    cut = [clip[: max(0, frames - end + len(clip))] for clip, end in zip(clips, ends, strict=True)]
    return [np.asarray(clip, float) for clip in cut if len(clip) > 2 * FRAME_RATE]


def spread(clips: Sequence[np.ndarray], frames: int, passages: int = 3) -> list[np.ndarray]:
    """The beginnings of a few clips from all over, so many frames together."""
    chosen = clips[:: max(1, len(clips) // passages)][:passages]
    return [clip for clip in (clip[: frames // passages] for clip in chosen) if len(clip) > 2 * FRAME_RATE]


def planned(robot: Robot, solver: Watched, clip: np.ndarray) -> JointTrajectory:
    planner = Retargeter(robot)
    planner._solver = solver
    return planner.push(KeypointClip(0, clip))


def compared(
    robot: Robot, make: Callable[[], Solve], clips: Sequence[np.ndarray], smoothing: float = SMOOTHING
) -> dict[str, float]:
    """What becomes of the clips' directions on a robot, whose frames a solver gives."""
    own, clearance = DirectionSolver(robot), Clearance(robot)
    off, jerks, spectra, busy, frames, touches, broken = [], [], [], 0.0, 0, 0, 0
    for clip in clips:
        solver = Watched(make())
        with patch.object(retargeter, "SMOOTHING", smoothing):
            plan = planned(robot, solver, clip)
        broken += violations(robot, plan)
        busy, frames = busy + solver.busy, frames + len(solver.poses)
        touches += sum(bool(clearance.under(pose, 0.0)) for pose in solver.poses)
        ticks = np.arange(ARRIVED, (len(clip) - 1) * TICK_RATE // FRAME_RATE)
        moments = ticks * FRAME_RATE / TICK_RATE
        asked = directions(CubicSpline(np.arange(len(clip)), clip)(moments))[:, BONES]
        shown = [
            np.array([own.reached(position) for position in positions[ticks]])[:, BONES]
            for positions in (plan.positions, at_the_bus(robot, plan))
        ]
        off.append(np.stack([angle_between(reached, asked) for reached in shown]))
        seen = np.stack([asked, *shown])
        jerks.append(np.linalg.norm(np.diff(seen, 3, axis=1), axis=-1).mean(axis=2).T)
        _, power = welch(seen, TICK_RATE, nperseg=min(len(ticks), 4 * TICK_RATE), nfft=1024, axis=1)
        spectra.append(power.sum(axis=(2, 3)) * len(ticks))
    angles, (human, robots, sent) = np.concatenate(off, axis=1), np.concatenate(jerks).mean(axis=0)
    peaks = np.sum(spectra, axis=0).argmax(axis=1) * TICK_RATE / 1024
    return {
        "median": float(np.median(angles[0])),
        "p95": float(np.percentile(angles[0], 95)),
        "jerk_ratio": float(robots / human),
        "sent_p95": float(np.percentile(angles[1], 95)),
        "sent_jerk_ratio": float(sent / human),
        "input_hz": float(peaks[0]),
        "output_hz": float(peaks[1]),
        "violations": broken,
        "penetrations": touches,
        "poses_per_second": frames / busy,
    }


def violations(robot: Robot, plan: JointTrajectory) -> int:
    """Ticks of a plan at which a joint is outside its position, velocity or acceleration limits."""
    limits = robot.limits
    outside = (plan.positions < limits.lower - SLACK) | (plan.positions > limits.upper + SLACK)
    outside |= np.abs(plan.velocities) > limits.velocity + SLACK
    changes = np.diff(plan.velocities, axis=0, prepend=plan.velocities[:1]) * TICK_RATE
    outside |= np.abs(changes) > limits.acceleration + SLACK * TICK_RATE
    return int(outside.any(axis=1).sum())


def measure(path: str, clips: Sequence[np.ndarray], ikpy_frames: int) -> dict[str, float]:
    """One robot and one block of motion."""
    robot = load_robot(path)
    ours = compared(robot, lambda: DirectionSolver(robot).solve, clips)
    bodiless = compared(robot, lambda: without_body(robot).solve, clips)
    clipped = compared(robot, lambda: ClippedAngles(robot).solve, clips, smoothing=0.0)
    figures = {
        "direction_error_deg_median": ours["median"],
        "direction_error_deg_p95": ours["p95"],
        "baseline_p95": clipped["p95"],
        "jerk_ratio": ours["jerk_ratio"],
        "baseline_jerk_ratio": clipped["jerk_ratio"],
        "sent_p95": ours["sent_p95"],
        "baseline_sent_p95": clipped["sent_p95"],
        "sent_jerk_ratio": ours["sent_jerk_ratio"],
        "baseline_sent_jerk_ratio": clipped["sent_jerk_ratio"],
        "without_body_p95": bodiless["p95"],
        "without_body_jerk_ratio": bodiless["jerk_ratio"],
        "without_body_penetrations": bodiless["penetrations"],
        "baseline_penetrations": clipped["penetrations"],
        "input_hz": ours["input_hz"],
        "output_hz": ours["output_hz"],
        "poses_per_second": ours["poses_per_second"],
        "violations": ours["violations"],
        "penetrations": ours["penetrations"],
        "minutes": sum(map(len, clips)) / FRAME_RATE / 60,
    }
    if passages := spread(clips, ikpy_frames):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # where it starts on a limit
            ikpy = compared(robot, lambda: PerLinkIK(robot).solve, passages, smoothing=0.0)
        same = compared(robot, lambda: DirectionSolver(robot).solve, passages)
        for name in ("p95", "jerk_ratio", "sent_p95", "sent_jerk_ratio"):
            figures |= {f"ikpy_{name}": ikpy[name], f"beside_ikpy_{name}": same[name]}
        figures["ikpy_penetrations"] = ikpy["penetrations"]
        figures["ikpy_poses_per_second"] = ikpy["poses_per_second"]
    return figures


def provoke(path: str, poses: int, seed: int) -> dict[str, int]:
    """Ask for random poses: what touches or leaves limits, in frames, in ticks, and behind the envelope."""
    robot = load_robot(path)
    own, clearance, random = DirectionSolver(robot), Clearance(robot), np.random.default_rng(seed)

    def anything(_: np.ndarray, previous: np.ndarray) -> np.ndarray:
        targets = random.standard_normal((len(DIRECTIONS), 3))
        return own.solve(targets / np.linalg.norm(targets, axis=1, keepdims=True), previous)

    def touches(positions: np.ndarray) -> int:
        return sum(bool(clearance.under(position, 0.0)) for position in positions)

    planner, solver = Retargeter(robot), Watched(anything)
    planner._solver = solver
    envelope = Envelope(robot.limits, 1 / TICK_RATE, robot.rest, CollisionGuard(robot, 1 / TICK_RATE))
    counts = dict.fromkeys(("violations", "penetrations", "planned_penetrations", "sent_penetrations"), 0)
    any_clip = demo_clips()[0][:1]
    for block in range(-(-poses // BLOCK)):
        size = min(BLOCK, poses - block * BLOCK)
        solver.poses.clear()
        plan = planner.push(KeypointClip(block * BLOCK, np.repeat(any_clip, size, axis=0)))
        # The next block begins where this plan is by then.
        ticks = slice(0, size * TICK_RATE // FRAME_RATE)
        counts["violations"] += violations(robot, plan)
        counts["penetrations"] += touches(np.array(solver.poses))
        counts["planned_penetrations"] += touches(plan.positions[ticks])
        sent = [envelope.step(*tick) for tick in zip(plan.positions[ticks], plan.velocities[ticks])]  # noqa: B905
        counts["sent_penetrations"] += touches(np.array(sent))
    return {**counts, "poses": poses}


def add_robot(name: str, folder: str) -> str:
    """The path of a proposed mapping."""
    path = Path(folder) / f"{name}.yaml"
    write_mapping(path, propose(name, read_urdf(URDFS[name]), str(URDFS[name])))
    return str(path)


def show(title: str, robots: Mapping[str, Mapping[str, float]]) -> None:
    table = Table("", *robots, title=title, title_justify="left")
    for name in next(iter(robots.values()), {}):
        table.add_row(name, *(f"{figures[name]:.4g}" for figures in robots.values()))
    Console(width=160).print(table)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--motion", type=Path, help="folder of recordings of people: a second block")
    parser.add_argument("--poses", type=int, default=100_000, help="random poses of all robots together")
    parser.add_argument("--minutes", type=float, default=10.0, help="of each block at most")
    parser.add_argument("--ikpy", type=float, default=30.0, help="seconds of each block that ikpy solves")
    parser.add_argument("--robots", nargs="*", default=["toa", *URDFS], help="some of them")
    parser.add_argument("--workers", type=int, default=None, help="processes")
    options = parser.parse_args()
    robots = [name for name in options.robots if name == "toa" or URDFS[name].exists()]
    frames = round(min(FRAMES, options.minutes * 60 * FRAME_RATE))
    blocks = {"demo corpus": up_to(demo_clips(), frames)}
    if options.motion:
        blocks["recordings"] = up_to(list(recorded_clips(options.motion)), frames)
    results: dict[str, dict[str, dict[str, float]]] = {name: {} for name in robots}
    with (
        tempfile.TemporaryDirectory() as folder,
        ProcessPoolExecutor(options.workers, initializer=threadpool_limits, initargs=(1,)) as pool,
    ):
        adding = {name: pool.submit(add_robot, name, folder) for name in robots if name != "toa"}
        paths = {"toa": str(config_dir() / "robots" / "toa.yaml")}
        paths |= {name: added.result() for name, added in tqdm(adding.items(), "adding robots")}
        jobs = {}
        for name in robots:
            for block, clips in blocks.items():
                job = pool.submit(measure, paths[name], clips, round(options.ikpy * FRAME_RATE))
                jobs[job] = name, block
            jobs[pool.submit(provoke, paths[name], options.poses // len(robots), 0)] = name, "random poses"
        for job in tqdm(as_completed(jobs), "measuring", len(jobs)):
            name, block = jobs[job]
            results[name][block] = {key: round(value, 3) for key, value in job.result().items()}
            tqdm.write(f"{name}, {block}: {results[name][block]}")
    for block in (*blocks, "random poses"):
        show(block, {name: results[name][block] for name in robots})
    summary = {}
    for name in robots:
        first, *rest = results[name].pop("demo corpus"), *results[name].values()
        for key in ("violations", "penetrations"):
            first[key] += sum(block[key] for block in rest)
        summary[name] = {**first, **results[name]}
    print(json.dumps({"bench": "retarget", **summary, "machine": machine()}))


if __name__ == "__main__":
    main()
