"""Does a mapping fit its robot: what a person would look for before they let it move."""

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from typing import Literal, NamedTuple

import numpy as np

from gesture_bot.retarget.clearance import Clearance
from gesture_bot.retarget.description import Arm, Mapping
from gesture_bot.retarget.kinematics import Kinematics
from gesture_bot.retarget.reach import BONES, angle_between, misses
from gesture_bot.retarget.robot import Robot
from gesture_bot.retarget.solver import DirectionSolver
from gesture_bot.retarget.urdf_file import joint_range

CLOSE = 0.01
"""The rest pose should keep the arms farther than this from the rest of the robot [m]."""

ASKEW = 30.0
"""An axis that is farther off than this is probably the wrong one [degrees]."""

WILD = 200.0
"""Gestures ask for an eighth of this acceleration, and a geared servo hardly reaches it [rad/s^2]."""

SHORT = 25.0
"""A pose that a bone misses by more is out of reach [degrees]."""


class Finding(NamedTuple):
    """One line of a check: is it well, worth a look, or bad, and what was found."""

    check: str
    state: Literal["ok", "look", "bad"]
    text: str


def check_mapping(robot: Robot) -> list[Finding]:
    """Check limits, chains, axes, rest pose and reach. Only `bad` findings keep a robot from gesturing.

    Raises:
        RobotError: MuJoCo cannot make a model of the URDF, or two links of an arm lie on one point.
    """
    kinematics = Kinematics(robot)
    findings = [_limits(robot), *_gaps(robot, kinematics), *_chains(robot, kinematics)]
    if any(finding.state == "bad" for finding in findings):
        return findings
    solver = DirectionSolver(robot)
    return [
        *findings,
        *_axes(robot, kinematics, solver),
        _hands(robot, kinematics, solver),
        _rest(robot),
        *_reach(robot),
    ]


def _limits(robot: Robot) -> Finding:
    limits = robot.limits
    wild = [joint for joint, most in zip(robot.joints, limits.acceleration, strict=True) if most > WILD]
    if wild:
        return Finding("limits", "look", f"faster than {WILD:g} rad/s2: {', '.join(wild)}")
    ranges = np.degrees(limits.upper - limits.lower)
    stiff = [joint for joint, turn in zip(robot.joints, ranges, strict=True) if turn < 5]
    if stiff:
        return Finding("limits", "look", f"under 5 degrees: {', '.join(stiff)}")
    return Finding(
        "limits",
        "ok",
        f"{len(ranges)} joints turn {ranges.min():.0f} to {ranges.max():.0f} degrees, at most "
        f"{_span(limits.velocity)} rad/s and {_span(limits.acceleration)} rad/s2",
    )


def _gaps(robot: Robot, kinematics: Kinematics) -> Iterator[Finding]:
    """What the URDF does not say of the joints of arms, head and waist, or says as it cannot be."""
    joints = {
        joint.get("name", ""): joint
        for joint in ElementTree.fromstring(robot.urdf).findall("joint")
        if joint.get("type") == "revolute" and joint.find("mimic") is None
    }
    mapping = robot.mapping
    ends = (mapping.left_arm.hand, mapping.right_arm.hand, mapping.head.link)
    used = {joint for link in ends for joint in _joints_above(kinematics, link)}
    for name in sorted(used.intersection(joints) - set(robot.joints)):
        lower, upper, _ = joint_range(joints[name])
        if lower >= upper:
            text = f"left out: {name}, for its range in the URDF is from {lower:g} to {upper:g}"
            yield Finding("limits", "look", text)
        elif np.inf in (-lower, upper):
            yield Finding("limits", "look", f"left out: {name}, for it has no range in the URDF")
    unsaid = [
        name for name in robot.joints if name in joints and joint_range(joints[name]).velocity == np.inf
    ]
    if unsaid:
        text = f"no velocity in the URDF, and the YAML file's is taken: {', '.join(unsaid)}"
        yield Finding("limits", "look", text)


def _chains(robot: Robot, kinematics: Kinematics) -> Iterator[Finding]:
    mapping, moving = robot.mapping, set(robot.joints)
    inside = set(_joints_above(kinematics, mapping.torso))
    used: set[str] = set()
    for side, arm in (("left", mapping.left_arm), ("right", mapping.right_arm)):
        yield _arm(kinematics, mapping, side, moving)
        used |= set(_joints_above(kinematics, arm.hand)) - inside
    neck = [joint for joint in _joints_above(kinematics, mapping.head.link) if joint in moving - inside]
    yield Finding("head", "ok" if neck else "look", ", ".join(neck) or "no joint turns it; it keeps still")
    idle = [joint for joint in robot.joints if joint not in used | set(neck)]
    yield Finding("other joints", "ok", f"kept at rest: {', '.join(idle)}" if idle else "none")
    lengths = [_lengths(kinematics, arm) for arm in (mapping.left_arm, mapping.right_arm)]
    even = np.allclose(lengths[0], lengths[1], rtol=0.05)
    text = ", ".join(
        f"{bone} {left:.3f} and {right:.3f} m"
        for bone, left, right in zip(("upper arms", "forearms"), *lengths, strict=True)
    )
    yield Finding("lengths", "ok" if even else "look", text)


def _arm(kinematics: Kinematics, mapping: Mapping, side: str, moving: set[str]) -> Finding:
    """Whether an arm's links hang on each other, on its side of the torso, and by which joints."""
    check, arm = f"{side} arm", mapping.left_arm if side == "left" else mapping.right_arm
    for outer, inner in (
        (arm.shoulder, mapping.torso),
        (arm.elbow, arm.shoulder),
        (arm.wrist, arm.elbow),
        (arm.hand, arm.elbow),
    ):
        if kinematics.link(inner) not in _ancestors(kinematics, outer):
            return Finding(check, "bad", f"{outer} does not hang on {inner}")
    leftward = kinematics.rotation(mapping.torso) @ mapping.torso_axes()[:, 1]
    out = leftward @ (kinematics.position(arm.shoulder) - kinematics.position(mapping.torso))
    if (out > 0) != (side == "left"):
        return Finding(check, "bad", f"{arm.shoulder} is on the other side of {mapping.torso}")
    inside = len(_joints_above(kinematics, mapping.torso))
    middle = len(_joints_above(kinematics, arm.elbow))
    joints = _joints_above(kinematics, arm.hand)
    still = [joint for joint in joints[inside:] if joint not in moving]
    counts = [len(moving.intersection(part)) for part in (joints[inside:middle], joints[middle:])]
    text = f"{arm.shoulder}, {arm.elbow}, {arm.wrist}; {counts[0]} joints to the elbow, {counts[1]} beyond it"
    if still:
        return Finding(check, "look", f"{text}; not in the table, and held at zero: {', '.join(still)}")
    return Finding(check, "ok", text)


def _lengths(kinematics: Kinematics, arm: Arm) -> np.ndarray:
    """(2,) of upper arm and forearm [m]."""
    wrist = kinematics.position(arm.wrist, arm.wrist_at)
    points = np.array([kinematics.position(arm.shoulder), kinematics.position(arm.elbow), wrist])
    return np.linalg.norm(np.diff(points, axis=0), axis=1)


def _axes(robot: Robot, kinematics: Kinematics, solver: DirectionSolver) -> Iterator[Finding]:
    kinematics.place(robot.rest)
    torso = kinematics.rotation(robot.mapping.torso) @ robot.mapping.torso_axes()
    lean = angle_between(torso[:, 2], np.array([0, 0, 1]))
    yield Finding("torso", _state(float(lean)), f"leans {lean:.0f} degrees at rest")
    reached = solver.reached(robot.rest)
    off = angle_between(reached[6], np.array([1, 0, 0]))
    yield Finding("face", _state(float(off)), f"looks {off:.0f} degrees off the torso's front at rest")
    along = abs(90 - angle_between(reached[[1, 4]], reached[[2, 5]]))
    text = f"{along[0]:.0f} and {along[1]:.0f} degrees off square to the forearms at rest"
    yield Finding("palms", _state(float(along.max())), text)


def _hands(robot: Robot, kinematics: Kinematics, solver: DirectionSolver) -> Finding:
    """Whether the arms rest as arms do: both alike, with the hands below the shoulders."""
    kinematics.place(robot.rest)
    mapping = robot.mapping
    up = (kinematics.rotation(mapping.torso) @ mapping.torso_axes())[:, 2]
    below = [
        up @ (kinematics.position(arm.shoulder) - kinematics.position(arm.hand))
        for arm in (mapping.left_arm, mapping.right_arm)
    ]
    left, right = np.split(solver.reached(robot.rest)[BONES], 2)
    differ = angle_between(left, right * [1, -1, 1]).max()
    height = f"{below[0]:.2f} and {below[1]:.2f} m below the shoulders"
    high = [side for side, drop in zip(("left", "right"), below, strict=True) if drop <= 0]
    if high:
        height = f"above the shoulder: {' and '.join(high)}"
    text = f"{height}; left and right arm differ by {differ:.0f} degrees"
    return Finding("hands at rest", "ok" if not high and differ <= ASKEW else "look", text)


def _rest(robot: Robot) -> Finding:
    nearest = Clearance(robot).nearest(robot.rest)
    text = f"{' and '.join(nearest.links)} are {100 * nearest.distance:.1f} cm apart"
    if nearest.distance <= 0:
        return Finding("rest pose", "bad", f"{text}: they collide")
    return Finding("rest pose", "ok" if nearest.distance >= CLOSE else "look", text)


def _reach(robot: Robot) -> Iterator[Finding]:
    for name, off in misses(robot).items():
        text = f"upper arms within {off[[0, 2]].max():.0f}, forearms within {off[[1, 3]].max():.0f} degrees"
        yield Finding(name, "ok" if off.max() <= SHORT else "look", text)


def _ancestors(kinematics: Kinematics, link: str) -> list[int]:
    """A link and those it hangs on."""
    found = [kinematics.link(link)]
    while found[-1]:
        found.append(int(kinematics.model.body_parentid[found[-1]]))
    return found


def _joints_above(kinematics: Kinematics, link: str) -> list[str]:
    """Names of the joints from the base to a link."""
    model = kinematics.model
    owners = _ancestors(kinematics, link)[::-1]
    return [
        model.joint(joint).name for owner in owners for joint in np.flatnonzero(model.jnt_bodyid == owner)
    ]


def _state(off: float) -> Literal["ok", "look"]:
    return "ok" if off <= ASKEW else "look"


def _span(values: np.ndarray) -> str:
    low, high = f"{values.min():.3g}", f"{values.max():.3g}"
    return low if low == high else f"{low} to {high}"
