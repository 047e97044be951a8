"""How far the retargeting of poses to NAO is from what animators chose for the same poses.

`python bench/animators.py FOLDER`, with the pairs of NAO-G (github.com/JasperRice/NAO-G): HUMAN.bvh, a pose a
frame, and NAO.csv, the joint angles that somebody chose for each [rad]. NAO's mapping is the one that
`gesture-bot robot add` proposes. The last line is one JSON object.
"""

import csv
import json
import sys
import tempfile
from pathlib import Path

import numpy as np
from machine import machine
from rich.console import Console
from rich.table import Table
from tqdm import tqdm

from gesture_bot.corpus.one_body import in_pelvis_frame, in_standard_size
from gesture_bot.corpus.readers import reader_of
from gesture_bot.corpus.skeletons import load_skeleton
from gesture_bot.retarget.directions import DIRECTIONS, directions
from gesture_bot.retarget.mapping_file import write_mapping
from gesture_bot.retarget.proposal import propose
from gesture_bot.retarget.reach import angle_between
from gesture_bot.retarget.robot import Robot, load_robot, read_urdf
from gesture_bot.retarget.solver import DirectionSolver

sys.path.insert(0, str(Path(__file__).parents[1] / "test"))
from installed_robots import URDFS  # noqa: E402  from test/

FRAMES = 30
"""So long a pose is held; by then the robot is there."""


def chosen(path: Path, robot: Robot) -> np.ndarray:
    """(n, j) angles of the animators [rad]."""
    with path.open() as file:
        names, *rows = csv.reader(file)
    columns = [name.strip(" '") for name in names]
    return np.array(rows, float)[:, [columns.index(joint) for joint in robot.joints]]


def asked(path: Path) -> np.ndarray:
    """(n, 8, 3) directions of the people."""
    take = next(iter(reader_of(path).read(path)))
    return directions(in_pelvis_frame(in_standard_size(load_skeleton("trinity").keypoints(take))))


def main() -> None:
    folder = Path(sys.argv[1])
    with tempfile.TemporaryDirectory() as made:
        mapping = Path(made) / "nao.yaml"
        write_mapping(mapping, propose("nao", read_urdf(URDFS["nao"]), str(URDFS["nao"])))
        robot = load_robot(str(mapping))
    solver, theirs = DirectionSolver(robot), chosen(folder / "NAO.csv", robot)
    targets = asked(folder / "HUMAN.bvh")[: len(theirs)]
    ours = []
    for target in tqdm(targets, "poses"):
        angles = robot.rest
        for _ in range(FRAMES):
            angles = solver.solve(target, angles)
        ours.append(angles)
    off = np.degrees(np.abs(np.array(ours) - theirs))
    spread = np.degrees(np.abs(theirs - theirs.mean(axis=0)))
    errors = {
        name: angle_between(np.array([solver.reached(pose) for pose in poses]), targets)
        for name, poses in (("ours", ours), ("animators", theirs))
    }
    joints = {
        joint: {"difference_deg": round(float(one), 1), "animators_spread_deg": round(float(other), 1)}
        for joint, one, other in zip(robot.joints, off.mean(axis=0), spread.mean(axis=0), strict=True)
    }
    rows = {
        name: {f"{who}_off_person_deg": round(float(error[:, i].mean()), 1) for who, error in errors.items()}
        for i, name in enumerate(DIRECTIONS[:-1])
    }
    for title, figures in (("joints", joints), ("directions", rows)):
        table = Table(title, *next(iter(figures.values())))
        for name, values in figures.items():
            table.add_row(name, *map(str, values.values()))
        Console(width=100).print(table)
    result = {"poses": len(theirs), "mean_difference_deg": round(float(off.mean()), 1)}
    print(
        json.dumps(
            {"bench": "animators", **result, "joints": joints, "directions": rows, "machine": machine()}
        )
    )


if __name__ == "__main__":
    main()
