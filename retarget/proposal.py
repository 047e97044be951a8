"""A first mapping for a robot that is only known by its URDF, for people to correct."""

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from typing import Any

import mujoco
import numpy as np

from gesture_bot.base.errors import RobotError
from gesture_bot.retarget.chains import ArmLinks, Body, find_body
from gesture_bot.retarget.description import Arm, Bus, Head, Joint, Mapping, RobotDescription
from gesture_bot.retarget.kinematics import Kinematics
from gesture_bot.retarget.rest_pose import rest_pose
from gesture_bot.retarget.robot import assemble
from gesture_bot.retarget.urdf_file import joint_range

SERVO = "XM430-W210"
"""Stands for servos that nobody has named yet."""

FASTEST = 6.4
"""80% of that servo's no-load speed at 12 V, 77 rpm (ROBOTIS e-Manual) [rad/s]."""

ACCELERATION = 25.0
"""As quick as a gesture needs [rad/s^2]."""

TURN = 3.1
"""How far either way a joint without limits may turn [rad]; just inside a servo's one turn."""


def propose(name: str, urdf: str, path: str) -> RobotDescription:
    """Find a body in a URDF, and let its arms hang down.

    The servos are made up: they move on the virtual bus and stand for those of the robot.

    Args:
        name: The robot's name, for errors.
        urdf: The URDF, as XML.
        path: Where the description will say that the URDF is.

    Raises:
        RobotError: No body is found, or the URDF cannot be read.
    """
    body = find_body(name, urdf)
    joints = _joints(urdf, body)
    missing = [
        side for side, arm in (("left", body.left), ("right", body.right)) if not joints.keys() & arm.joints
    ]
    if missing:
        raise RobotError(f"{name} has an arm whose joints have no range", missing[0])
    bus = Bus(baudrate=1_000_000, protocol=2.0, lag_ms=0.0, watchdog_ms=200, on_exit="rest_then_off")
    # Any palms do until the arms hang.
    first = RobotDescription(
        urdf=path, mapping=_mapping(body, [(0.0, 0.0, 1.0)] * 2, (1.0, 0.0, 0.0)), joints=joints, bus=bus
    )
    rest = rest_pose(assemble(name, urdf, first)).tolist()
    joints = {
        joint: row.model_copy(update={"rest": angle})
        for (joint, row), angle in zip(joints.items(), rest, strict=True)
    }
    hanging = first.model_copy(update={"joints": joints})
    kinematics = Kinematics(assemble(name, urdf, hanging))
    torso = kinematics.rotation(body.torso) @ first.mapping.torso_axes()
    palms = [
        _palm(kinematics, arm, sign * torso[:, 1]) for arm, sign in ((body.left, -1.0), (body.right, 1.0))
    ]
    face = _axis(torso[:, 0] @ kinematics.rotation(body.head))
    return hanging.model_copy(update={"mapping": _mapping(body, palms, face)})


def _mapping(
    body: Body, palms: list[tuple[float, float, float]], face: tuple[float, float, float]
) -> Mapping:
    arms = [
        Arm(
            shoulder=arm.shoulder,
            elbow=arm.elbow,
            wrist=arm.wrist,
            hand=arm.hand,
            palm=palm,
            **({} if arm.wrist_at is None else {"wrist_at": tuple(arm.wrist_at.round(3).tolist())}),
        )
        for arm, palm in zip((body.left, body.right), palms, strict=True)
    ]
    return Mapping(
        torso=body.torso,
        forward=_axis(body.forward),
        up=_axis(body.up),
        left_arm=arms[0],
        right_arm=arms[1],
        head=Head(link=body.head, forward=face),
    )


def _joints(urdf: str, body: Body) -> dict[str, Joint]:
    """A servo for each joint of arms, neck and waist that can turn, with limits where the URDF has none."""
    elements = {joint.get("name", ""): joint for joint in ElementTree.fromstring(urdf).findall("joint")}
    rows = {}
    groups = (body.left.joints, body.right.joints, body.neck, body.waist)
    for tens, group in enumerate(groups, start=1):
        for number, name in enumerate(group, start=1):
            lower, upper, velocity = joint_range(elements[name])
            endless = elements[name].get("type") == "continuous"
            if lower >= upper or not (endless or np.isfinite([lower, upper]).all()):
                continue  # which `checks` tells
            narrowed: dict[str, Any] = {}
            if endless or upper - lower > 2 * TURN:
                lower, upper = -TURN, TURN
                narrowed |= {"lower": lower, "upper": upper}
            if velocity > FASTEST:
                narrowed |= {"velocity": FASTEST}
            # Servos turn as far either way; a joint with a range all on one side needs their middle there.
            offset = 0.0 if max(-lower, upper) <= TURN else round(-(lower + upper) / 2, 3)
            rows[name] = Joint(
                id=10 * tens + number,
                model=SERVO,
                direction=1,
                offset=offset,
                rest=float(np.clip(0, lower, upper)),
                acceleration=ACCELERATION,
                **narrowed,
            )
    return rows


def _palm(kinematics: Kinematics, arm: ArmLinks, inward: np.ndarray) -> tuple[float, float, float]:
    """Out of the palm, across the forearm: to where fingers close, or else to the body as the arm hangs."""
    wrist = kinematics.position(arm.wrist)
    if arm.wrist_at is not None:
        wrist += kinematics.rotation(arm.wrist) @ arm.wrist_at
    forearm = wrist - kinematics.position(arm.elbow)
    closing = _closing(kinematics, arm.hand)
    palm = inward if closing is None else closing
    palm = palm - (palm @ forearm) / (forearm @ forearm) * forearm
    return _axis(palm @ kinematics.rotation(arm.hand), near=0.45)


def _closing(kinematics: Kinematics, hand: str) -> np.ndarray | None:
    """(3,) where most fingertips move when the fingers close, None without fingers or if they disagree."""
    model, data = kinematics.model, kinematics.data
    angles = data.qpos.copy()
    moves = []
    for joint, tip in _fingers(model, kinematics.link(hand)):
        address = model.jnt_qposadr[joint]
        ends = []
        for angle in model.jnt_range[joint]:
            data.qpos[address] = angle
            mujoco.mj_kinematics(model, data)
            ends.append(data.xipos[tip] - data.xpos[kinematics.link(hand)])
        data.qpos[:] = angles
        mujoco.mj_kinematics(model, data)
        shut, open_ = sorted(ends, key=lambda end: float(np.linalg.norm(end)))
        moves.append(shut - open_)
    total = np.sum(moves, axis=0) if moves else np.zeros(3)
    agreed = np.linalg.norm(total) > 0.3 * np.sum([np.linalg.norm(move) for move in moves])
    return total if moves and agreed else None


def _fingers(model: mujoco.MjModel, hand: int) -> Iterator[tuple[int, int]]:
    """Turning joints beyond a hand, each with the last link that it moves."""
    beyond = [hand]
    for body in range(hand + 1, model.nbody):
        if model.body_parentid[body] in beyond:
            beyond.append(body)
    for body in beyond[1:]:
        if model.body_jntnum[body] and model.jnt_type[model.body_jntadr[body]] == mujoco.mjtJoint.mjJNT_HINGE:
            tip = body
            for below in beyond:
                tip = below if model.body_parentid[below] == tip else tip
            yield int(model.body_jntadr[body]), tip


def _axis(vector: np.ndarray, near: float = 0.05) -> tuple[float, float, float]:
    """The unit vector, as short to write as can be: an axis of the frame where it is near one."""
    unit = np.asarray(vector) / np.linalg.norm(vector)
    largest = np.abs(unit).argmax()
    axis = np.zeros(3)
    axis[largest] = np.sign(unit[largest])
    x, y, z = ((axis if np.linalg.norm(unit - axis) < near else unit.round(4)) + 0.0).tolist()  # no -0.0
    return x, y, z
