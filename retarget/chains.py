"""Finding a body in a URDF: which of its links are like a person's torso, arms and head.

Everything is read off the robot at zero, with z up as in REP-103. Names only tell left from right.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import mujoco
import numpy as np

from gesture_bot.base.errors import RobotError
from gesture_bot.retarget.urdf_model import mimics, urdf_model

ARM_JOINTS = 3
"""Fewer joints in a row are no arm."""

ALIKE = 0.05
"""Two chains are a pair if their lengths differ by no more than this share of the whole."""

BENDS = 0.7
"""A joint bends a limb, and does not roll it, if the cosine of the angle between them is less."""


@dataclass(frozen=True)
class Chain:
    """Turning joints in a row, from the torso out, as indices of MuJoCo's model, and the link that ends it.

    The end is where fingers branch off, or nothing more moves.
    """

    joints: tuple[int, ...]
    end: int


@dataclass(frozen=True)
class ArmLinks:
    """Links of an arm, as in the mapping, and its joints from the shoulder out.

    `wrist_at` is (3,) where the wrist is in the frame of `wrist` [m], None for its origin.
    """

    shoulder: str
    elbow: str
    wrist: str
    wrist_at: np.ndarray | None
    hand: str
    joints: tuple[str, ...]


@dataclass(frozen=True)
class Body:
    """What was found.

    Attributes:
        torso: The link from which the arms go out.
        forward: (3,) of the torso, in its frame.
        up: (3,) of the torso, in its frame.
        waist: Joints between the base and the torso.
        left: Left arm.
        right: Right arm.
        head: The link that the neck turns, or the torso where there is no neck.
        neck: Joints from the torso to the head.
    """

    torso: str
    forward: np.ndarray
    up: np.ndarray
    waist: tuple[str, ...]
    left: ArmLinks
    right: ArmLinks
    head: str
    neck: tuple[str, ...]


def find_body(name: str, urdf: str) -> Body:
    """Find torso, arms and head in a URDF, as XML.

    The arms are the highest pair of chains of three or more joints that leave one link and have the same
    lengths. The head is the highest chain that goes out from the same link above them.

    Raises:
        RobotError: MuJoCo cannot read the URDF, or no two chains are like a pair of arms; `name` says whose.
    """
    return _Skeleton(name, urdf).body()


class _Skeleton:
    """A robot at zero, as a tree of links."""

    def __init__(self, name: str, urdf: str):
        self.name = name
        self.model = urdf_model(name, urdf)
        self.data = mujoco.MjData(self.model)
        mujoco.mj_kinematics(self.model, self.data)
        model = self.model
        self.children: list[list[int]] = [[] for _ in range(model.nbody)]
        for body in range(1, model.nbody):
            self.children[model.body_parentid[body]].append(body)
        self.moving = np.asarray(model.body_jntnum, int)
        for body in range(model.nbody - 1, 0, -1):
            self.moving[model.body_parentid[body]] += self.moving[body]
        hinges = model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE
        following = mimics(urdf)
        self.turns = [hinges[i] and model.joint(i).name not in following for i in range(model.njnt)]

    def body(self) -> Body:
        torso, arms = self._arms()
        left, right = self._left_and_right(*arms)
        rotation = self.data.xmat[torso].reshape(3, 3)
        sideways = self._apart(left, right)
        sideways[2] = 0
        up = np.array([0.0, 0.0, 1.0])
        forward = np.cross(sideways / np.linalg.norm(sideways), up)
        head = self._head(torso, arms)
        # Where the arms are measured a little differently, the one with the longer forearm speaks for both.
        parts = max(map(self._parts, (left, right)), key=lambda parts: self._forearm(left, *parts[1:]))
        return Body(
            torso=self._link(torso),
            forward=_tidy(forward @ rotation),
            up=_tidy(up @ rotation),
            waist=self._names(self._above(torso)),
            left=self._arm(left, *parts),
            right=self._arm(right, *parts),
            head=self._link(torso if head is None else head.end),
            neck=() if head is None else self._names(head.joints),
        )

    def _arms(self) -> tuple[int, tuple[Chain, Chain]]:
        """The torso, and the two chains that leave it highest."""
        pairs = list(self._pairs(1))
        if not pairs:
            message = f"{self.name} has no two chains of {ARM_JOINTS} or more joints that are a pair of arms"
            ends = [self._link(body) for body in range(1, self.model.nbody) if not self.children[body]]
            raise RobotError(f"{message}; its chains end in", ends)
        return max(pairs, key=lambda pair: sum(self._anchor(chain.joints[0])[2] for chain in pair[1]))

    def _pairs(self, body: int) -> Iterator[tuple[int, tuple[Chain, Chain]]]:
        """Pairs of chains that leave one link, outermost first: pairs of fingers are no news."""
        chains = {child: self._chain(child) for child in self.children[body]}
        paired: set[int] = set()
        for one, other in combinations(self.children[body], 2):
            pair = chains[one], chains[other]
            if pair[0] and pair[1] and self._alike(pair[0], pair[1]):
                paired |= {one, other}
                yield body, (pair[0], pair[1])
        for child in set(self.children[body]) - paired:
            yield from self._pairs(child)

    def _chain(self, body: int, shortest: int = ARM_JOINTS) -> Chain | None:
        """The chain that begins with a link, unless it has less than so many joints."""
        joints: list[int] = []
        while True:
            joints += [joint for joint in self._joints(body) if self.turns[joint]]
            onward = [child for child in self.children[body] if self.moving[child]]
            # What slides or mimics is a gripper.
            if len(onward) != 1 or not all(self.turns[joint] for joint in self._joints(onward[0])):
                break
            body = onward[0]
        if len(joints) < shortest:
            return None
        # A link that hangs fixed on the last joint's is as well the hand.
        return Chain(tuple(joints), int(self.model.jnt_bodyid[joints[-1]]))

    def _alike(self, one: Chain, other: Chain) -> bool:
        if len(one.joints) != len(other.joints):
            return False
        lengths = np.array([self._lengths(chain) for chain in (one, other)])
        starts = self._anchor(one.joints[0]), self._anchor(other.joints[0])
        tolerance = ALIKE * lengths.sum(axis=1).mean()
        return bool(
            np.abs(lengths[0] - lengths[1]).max() < tolerance
            and abs(starts[0][2] - starts[1][2]) < tolerance
            and np.linalg.norm(self._apart(one, other)[:2]) > tolerance
        )

    def _apart(self, one: Chain, other: Chain) -> np.ndarray:
        """(3,) from the other chain to one, where both begin, or else where they are first side by side [m].

        Joints that lift the shoulders may begin in one place.
        """
        gaps = [self._anchor(a) - self._anchor(b) for a, b in zip(one.joints, other.joints, strict=True)]
        near = ALIKE * (self._lengths(one).sum() + self._lengths(other).sum()) / 2
        return next((gap for gap in gaps if np.linalg.norm(gap[:2]) > near), gaps[-1])

    def _lengths(self, chain: Chain) -> np.ndarray:
        """Distances from joint to joint [m]."""
        anchors = np.array([self._anchor(joint) for joint in chain.joints])
        return np.linalg.norm(np.diff(anchors, axis=0), axis=1)

    def _left_and_right(self, one: Chain, other: Chain) -> tuple[Chain, Chain]:
        """Told by the first letters in which the joints' names differ, else by y, as x is forward."""
        for names in zip(self._names(one.joints), self._names(other.joints), strict=True):
            letters = next(((a, b) for a, b in zip(*names, strict=False) if a != b), ("", ""))
            match "".join(letters).lower():
                case "lr":
                    return one, other
                case "rl":
                    return other, one
        return (one, other) if self._apart(one, other)[1] > 0 else (other, one)

    def _head(self, torso: int, arms: tuple[Chain, Chain]) -> Chain | None:
        taken = {chain.joints[0] for chain in arms}
        chains = [self._chain(child, 1) for child in self.children[torso]]
        shoulders = np.mean([self._anchor(chain.joints[0])[2] for chain in arms])
        necks = [
            chain
            for chain in chains
            if chain and chain.joints[0] not in taken and self._anchor(chain.joints[-1])[2] > shoulders
        ]
        return max(necks, key=lambda chain: self._anchor(chain.joints[-1])[2], default=None)

    def _above(self, body: int) -> list[int]:
        """Turning joints from the base to a link."""
        joints: list[int] = []
        while body:
            joints[:0] = [joint for joint in self._joints(body) if self.turns[joint]]
            body = self.model.body_parentid[body]
        return joints

    def _parts(self, chain: Chain) -> tuple[int, int, int | None]:
        """Which of a chain's joints are shoulder, elbow and wrist; None where no joint is at the wrist.

        The elbow is the joint that has a long way on both sides: the shorter of its distance to the farthest
        axis before it and of the tip's distance to its own axis is the longest. The shoulder is the last
        joint before that moves the elbow much, and does not only roll the upper arm. The wrist is the first
        joint after the elbow that bends, else the last one that is not at the elbow.
        """
        joints, tip = chain.joints, self._tip(chain)
        anchors = [self._anchor(joint) for joint in joints]
        levers = np.array([[self._lever(axis, point) for axis in joints] for point in (*anchors, tip)])

        def both_sides(elbow: int) -> float:
            upper = anchors[elbow] - anchors[int(levers[elbow, :elbow].argmax())]
            if np.linalg.norm(upper) > 0 and not self._bends(joints[elbow], upper):
                return 0.0
            return min(levers[elbow, :elbow].max(), levers[-1, elbow])

        elbow = max(range(1, len(joints)), key=both_sides)
        before = levers[elbow, :elbow]
        shoulder = int(np.flatnonzero(before > before.max() / 2)[-1])
        away = [
            joint
            for joint in range(elbow + 1, len(joints))
            if np.linalg.norm(anchors[joint] - anchors[elbow]) > before.max() / 5
        ]
        bending = [joint for joint in away if self._bends(joints[joint], anchors[joint] - anchors[elbow])]
        wrist = bending[0] if bending else away[-1] if away else None
        return shoulder, elbow, wrist

    def _forearm(self, chain: Chain, elbow: int, wrist: int | None) -> float:
        """Length of a forearm [m]."""
        end = self._tip(chain) if wrist is None else self._anchor(chain.joints[wrist])
        return float(np.linalg.norm(end - self._anchor(chain.joints[elbow])))

    def _arm(self, chain: Chain, shoulder: int, elbow: int, wrist: int | None) -> ArmLinks:
        joints = chain.joints
        link = chain.end if wrist is None else int(self.model.jnt_bodyid[joints[wrist]])
        at = None
        if wrist is None:
            at = (self._tip(chain) - self.data.xpos[link]) @ self.data.xmat[link].reshape(3, 3)
        return ArmLinks(
            shoulder=self._link(int(self.model.jnt_bodyid[joints[shoulder]])),
            elbow=self._link(int(self.model.jnt_bodyid[joints[elbow]])),
            wrist=self._link(link),
            wrist_at=at,
            hand=self._link(chain.end),
            joints=self._names(joints),
        )

    def _tip(self, chain: Chain) -> np.ndarray:
        """(3,) the far end of a chain's last link, or of what is fixed on it [m]. Fingers make no forearm."""
        start = self._anchor(chain.joints[-1])
        links = [chain.end]
        for link in links:
            links += [child for child in self.children[link] if not self.model.body_jntnum[child]]
        origins = self.data.xpos[links[1:]]
        # The centre of mass lies half way to the end.
        points = [*origins, start + 2 * (self.data.xipos[chain.end] - start)]
        return max(points, key=lambda point: float(np.linalg.norm(point - start)))

    def _bends(self, joint: int, limb: np.ndarray) -> bool:
        return bool(abs(self.data.xaxis[joint] @ limb) < BENDS * np.linalg.norm(limb))

    def _lever(self, joint: int, point: np.ndarray) -> float:
        """Distance of a point from a joint's axis [m]."""
        return float(np.linalg.norm(np.cross(self.data.xaxis[joint], point - self._anchor(joint))))

    def _joints(self, body: int) -> range:
        first = int(self.model.body_jntadr[body])
        return range(first, first + int(self.model.body_jntnum[body]))

    def _anchor(self, joint: int) -> np.ndarray:
        return self.data.xanchor[joint].copy()

    def _link(self, body: int) -> str:
        return self.model.body(body).name

    def _names(self, joints: list[int] | tuple[int, ...]) -> tuple[str, ...]:
        return tuple(self.model.joint(joint).name for joint in joints)


def _tidy(axis: np.ndarray) -> np.ndarray:
    """An axis of a frame where the vector is within a few degrees of one, else the vector."""
    nearest = np.round(axis)
    return nearest if np.linalg.norm(axis - nearest) < 0.05 else axis
