"""Robots that nobody here drew get a mapping from their URDF, and it is checked."""

import re
from pathlib import Path

import numpy as np
import pytest
import yaml
from installed_robots import EXTRAS, URDFS

from gesture_bot.base.errors import RobotError
from gesture_bot.base.files import config_dir
from gesture_bot.retarget.chains import find_body
from gesture_bot.retarget.checks import check_mapping
from gesture_bot.retarget.kinematics import Kinematics
from gesture_bot.retarget.mapping_file import write_mapping
from gesture_bot.retarget.proposal import propose
from gesture_bot.retarget.reach import BONES, POSES, WAVE, angle_between, both_arms, misses, taken_up
from gesture_bot.retarget.robot import Robot, load_robot
from gesture_bot.retarget.solver import DirectionSolver
from gesture_bot.retarget.urdf_file import read_urdf
from gesture_bot.retarget.urdf_model import urdf_model, urdf_spec
from gesture_bot.servo.table_check import table_problems

TOA = config_dir() / "robots" / "toa.urdf"

# Torso, shoulder, elbow, wrist and hand of the left arm, joints of an arm, the neck and the waist: as
# one reads them off the robots' drawings.
ANATOMY = {
    "jvrc": (
        "WAIST_R_S",
        ("L_SHOULDER_R_S", "L_ELBOW_P_S", "L_WRIST_R_S", "L_WRIST_Y_S"), (7, 3, 3),
    ),
    "nao": (
        "torso",
        ("LBicep", "LForeArm", "l_wrist", "l_wrist"), (5, 2, 0),
    ),
    "pepper": (
        "torso",
        ("LBicep", "LForeArm", "l_wrist", "l_wrist"), (5, 2, 3),
    ),
    "poppy": (
        "chest",
        ("l_shoulder_motor", "l_forearm", "l_forearm", "l_forearm"), (4, 2, 3),
    ),
    "g1": (
        "torso_link",
        ("left_shoulder_roll_link", "left_elbow_link", "left_wrist_pitch_link", "left_wrist_yaw_link"),
        (7, 0, 3),
    ),
    "g1_hand": (
        "torso_link",
        ("left_shoulder_roll_link", "left_elbow_link", "left_wrist_pitch_link", "left_wrist_yaw_link"),
        (7, 0, 3),
    ),
    "tiago_pro": (
        "torso_lift_link",
        ("arm_left_2_link", "arm_left_4_link", "arm_left_6_link", "arm_left_7_link"), (7, 2, 0),
    ),
    "baxter": (
        "torso",
        ("left_lower_shoulder", "left_lower_elbow", "left_lower_forearm", "left_wrist"), (7, 1, 0),
    ),
}  # fmt: skip


def urdf_of(name: str) -> Path:
    path = URDFS[name]
    if not path.exists() and EXTRAS in path.parents:
        pytest.skip("example-robot-data is not installed: 130 MB, not asked for by default")
    return path


@pytest.fixture(scope="module", params=ANATOMY)
def robot(request, tmp_path_factory) -> Robot:
    """A robot as `robot add` leaves it."""
    urdf = urdf_of(request.param)
    path = tmp_path_factory.mktemp("robots") / f"{request.param}.yaml"
    write_mapping(path, propose(request.param, read_urdf(urdf), str(urdf)))
    return load_robot(str(path))


def toa_with(tmp_path: Path, change) -> Robot:
    """Toa with a changed URDF, and the mapping that is proposed for it."""
    text = change(TOA.read_text())
    assert text != TOA.read_text()
    (tmp_path / "toa.urdf").write_text(text)
    write_mapping(tmp_path / "toa.yaml", propose("toa", text, "toa.urdf"))
    return load_robot(str(tmp_path / "toa.yaml"))


@pytest.mark.parametrize("name", ANATOMY)
def test_the_body_is_found(name):
    urdf, torso, links, counts = urdf_of(name), *ANATOMY[name]
    body = find_body(name, read_urdf(urdf))
    left = body.left
    assert body.torso == torso
    assert (left.shoulder, left.elbow, left.wrist, left.hand) == links
    assert (len(left.joints), len(body.neck), len(body.waist)) == counts
    assert len(body.right.joints) == counts[0]


def test_a_proposal_passes_every_check(robot):
    findings = check_mapping(robot)
    assert not [finding for finding in findings if finding.state == "bad"]
    # G1 has no neck; Pepper's arms are too short to lie on its belly without touching it.
    known = {"g1": {"head"}, "g1_hand": {"head"}, "pepper": {"hands on the belly"}}.get(robot.name, set())
    assert {finding.check for finding in findings if finding.state == "look"} <= known
    assert not list(table_problems(robot))


def test_the_arms_hang_at_the_robots_sides_and_the_palms_face_them(robot):
    solver = DirectionSolver(robot)
    upper, forearm, palm = (solver.reached(robot.rest)[[row, row + 3]] for row in range(3))
    assert (upper[:, 2] < -0.85).all()
    assert (forearm[:, 2] < -0.7).all()
    assert (forearm[:, 0] > 0).all()
    assert upper[0, 1] > 0 > upper[1, 1]
    # Pepper's elbow turns its palms back.
    assert robot.name == "pepper" or (palm[0, 1] < -0.7 and palm[1, 1] > 0.7)


def test_both_hands_go_up_when_a_persons_do(robot):
    solver, kinematics = DirectionSolver(robot), Kinematics(robot)
    targets = solver.reached(robot.rest)
    targets[BONES] = both_arms(POSES["hands up"])
    angles = robot.rest
    for _ in range(30):
        angles = solver.solve(targets, angles)
    kinematics.place(angles)
    for arm in (robot.mapping.left_arm, robot.mapping.right_arm):
        wrist = kinematics.position(arm.wrist) + kinematics.rotation(arm.wrist) @ arm.wrist_at
        assert wrist[2] > kinematics.position(arm.elbow)[2]
    missed = {pose: off.max() for pose, off in misses(robot).items()}
    assert max(missed.values()) < (30 if robot.name == "pepper" else 25)
    if robot.name == "poppy":
        # Its palms cannot turn, and do not draw its arms aside; on the belly its hands would touch.
        assert max(off for pose, off in missed.items() if pose != "hands on the belly") < 3


def test_a_hand_that_waves_stays_up_and_goes_from_side_to_side(robot):
    solver, kinematics = DirectionSolver(robot), Kinematics(robot)
    out = taken_up(robot, solver, WAVE[0], robot.rest)
    back = taken_up(robot, solver, WAVE[1], out)
    hands = []
    arm = robot.mapping.left_arm
    for share in np.linspace(0, 1, 9):  # as an operator who sends the joints from one to the other
        kinematics.place(out + share * (back - out))
        hands.append(kinematics.position(arm.wrist, arm.wrist_at) - kinematics.position(arm.elbow))
    hands = np.array(hands) / np.linalg.norm(hands, axis=1, keepdims=True)
    assert (hands[:, 2] > 0.3).all()
    # NAO's and Pepper's elbows bend no farther than square.
    assert angle_between(hands[0], hands[-1]) > (10 if robot.name in ("nao", "pepper") else 30)


def test_peppers_forearm_reaches_from_elbow_to_wrist():
    """Its URDF has the axes of this link's inertia mixed up: a box of this inertia would lie across."""
    model = urdf_model("pepper", read_urdf(urdf_of("pepper")))
    link, wrist = model.body("LForeArm"), model.body("l_wrist")
    (shape,) = (geom for geom in map(model.geom, range(model.ngeom)) if geom.bodyid == link.id)
    np.testing.assert_allclose(shape.pos, wrist.pos / 2, atol=1e-6)
    assert 0.02 < shape.size[0] < 0.05 and shape.size[1] == pytest.approx(0.075)


def test_derivatives_are_those_of_the_directions(robot):
    solver, random = DirectionSolver(robot), np.random.default_rng(1)
    angles = random.uniform(robot.limits.lower, robot.limits.upper)
    step = 1e-6 * random.standard_normal(len(angles))
    jacobian = solver.linearise(angles)[1]
    moved = (solver.reached(angles + step) - solver.reached(angles - step)) / 2
    inside = np.isin(robot.joints, [*find_body("", robot.urdf).waist], invert=True)
    np.testing.assert_allclose(jacobian[:, inside] @ step[inside], moved.ravel(), atol=1e-10)


def test_a_joint_that_mimics_another_follows_it(tmp_path):
    def coupled(text):
        for side in ("left", "right"):
            joint = f'<joint name="{side}_wrist" type="revolute">'
            mimic = f'<mimic joint="{side}_elbow" multiplier="-0.5" offset="0.2"/>'
            text = text.replace(joint, joint + mimic)
        return text

    robot = toa_with(tmp_path, coupled)
    assert "left_wrist" not in robot.joints
    kinematics, angles = Kinematics(robot), robot.rest.copy()
    angles[robot.joints.index("left_elbow")] = 1.0
    kinematics.place(angles)
    assert kinematics.data.joint("left_wrist").qpos[0] == pytest.approx(-0.3)
    solver, step = DirectionSolver(robot), np.full(len(angles), 1e-6)
    moved = (solver.reached(angles + step) - solver.reached(angles - step)) / 2
    np.testing.assert_allclose(solver.linearise(angles)[1] @ step, moved.ravel(), atol=1e-10)


def test_a_joint_without_end_is_given_one_turn(tmp_path):
    def endless(text):
        head, tail = text.split('<joint name="left_wrist" type="revolute">')
        limit = tail[tail.index("<limit") : tail.index("/>", tail.index("<limit")) + 2]
        return f'{head}<joint name="left_wrist" type="continuous">{tail.replace(limit, "", 1)}'

    robot = toa_with(tmp_path, endless)
    wrist = robot.joints.index("left_wrist")
    assert (robot.limits.lower[wrist], robot.limits.upper[wrist]) == (-3.1, 3.1)
    assert 0 < robot.limits.velocity[wrist] < 7
    assert not list(table_problems(robot))


@pytest.mark.parametrize("upper", [3.1, 3.141, 4.7])
def test_a_joint_that_turns_one_way_only_has_its_servos_middle_there(tmp_path, upper):
    def one_way(urdf):
        head, tail = urdf.split('<joint name="left_wrist"')
        limit = f'<limit lower="0" upper="{upper}" velocity="5"/>'
        return f'{head}<joint name="left_wrist"' + re.sub("<limit .*?/>", limit, tail, count=1)

    robot = toa_with(tmp_path, one_way)
    assert robot.limits.upper[robot.joints.index("left_wrist")] == upper
    assert not list(table_problems(robot))


@pytest.mark.parametrize(
    ("limit", "text"),
    [
        (
            'lower="1.6" upper="-1.6" velocity="5"',
            "left out: left_wrist, for its range in the URDF is from 1.6 to -1.6",
        ),
        ('velocity="5"', "left out: left_wrist, for it has no range"),
        ('lower="-1.6" upper="1.6" velocity="0"', "no velocity in the URDF, and the YAML file's"),
    ],
)
def test_what_the_urdf_does_not_say_of_a_joint_is_told(tmp_path, limit, text):
    def wrist(urdf):
        head, tail = urdf.split('<joint name="left_wrist"')
        return f'{head}<joint name="left_wrist"' + re.sub("<limit .*?/>", f"<limit {limit}/>", tail, count=1)

    robot = toa_with(tmp_path, wrist)
    assert ("left_wrist" in robot.joints) == text.startswith("no velocity")
    found = [finding.text for finding in check_mapping(robot) if finding[:2] == ("limits", "look")]
    assert len(found) == 1 and found[0].startswith(text)
    assert np.isfinite(robot.limits.velocity).all()


def test_arms_that_are_measured_a_little_differently_have_the_same_parts():
    urdf = read_urdf(urdf_of("jvrc"))
    for side, aside in (("L", 0.063), ("R", -0.058)):  # 46 and 44 degrees off the forearm: bends, and rolls
        for name, place in (("ELBOW_Y", f"0 {aside} -0.06"), ("WRIST_R", f"0 {-aside} -0.18")):
            joint = f'<joint name="{side}_{name}"'
            before, after = urdf.split(joint)
            urdf = before + joint + re.sub('xyz=".*?"', f'xyz="{place}"', after, count=1)
    body = find_body("jvrc", urdf)
    assert (body.left.wrist, body.right.wrist) == ("L_WRIST_R_S", "R_WRIST_R_S")


def test_arms_whose_first_joints_are_in_one_place_are_found(tmp_path):
    def from_the_middle(text):
        for side, y in (("left", 0.125), ("right", -0.125)):
            for name, before, after in (("pitch", f"0 {y} 0.17", "0 0 0.17"), ("roll", "0 0 0", f"0 {y} 0")):
                head, tail = text.split(f'<joint name="{side}_shoulder_{name}"')
                tail = tail.replace(f'xyz="{before}"', f'xyz="{after}"', 1)
                text = f'{head}<joint name="{side}_shoulder_{name}"{tail}'
        return text

    mapping = toa_with(tmp_path, from_the_middle).mapping
    assert (mapping.torso, mapping.left_arm.elbow) == ("torso", "left_forearm")
    np.testing.assert_allclose(mapping.torso_axes()[:, 0], [1, 0, 0], atol=1e-9)


def test_a_link_of_a_mesh_and_a_shape_of_no_size_has_its_box():
    urdf = """<robot name="one"><link name="base">
      <inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
      <visual><geometry><mesh filename="package://one/base.dae"/></geometry></visual>
      <collision><geometry><sphere radius="0"/></geometry></collision>
    </link></robot>"""
    assert urdf_spec("one", urdf).compile().ngeom == 1


def test_a_shape_of_no_size_is_left_out(tmp_path):
    nothing = '<visual><geometry><sphere radius="0.00"/></geometry></visual></link>'
    robot = toa_with(tmp_path, lambda text: text.replace("</link>", nothing))
    assert robot.mapping.left_arm.elbow == "left_forearm"


def test_a_robot_without_arms_is_told_what_it_has():
    with pytest.raises(RobotError, match="no two chains.*its chains end in.*left_hand"):
        find_body(
            "toa",
            TOA.read_text().replace("right_elbow", "other_elbow").replace('type="revolute"', 'type="fixed"'),
        )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("joint name='head_tilt'", "joint name='head_pan'"), "two joints are called: 'head_pan'"),
        (("link name='left_hand'", "link name='right_hand'"), "two links are called: 'right_hand'"),
        (("joint name='head_tilt'", "joint"), "a joint has no name, the one after: 'head_pan'"),
        (("lower='-0.6'", "lower='-pi/4'"), "lower of head_tilt is not a number: '-pi/4'"),
        (
            ("origin xyz='0 ", "origin xyz='0, "),
            "xyz of an origin in the link base_link is not three numbers: '0, 0",
        ),
        (("<robot ", "<robot xmlns:xacro='http://www.ros.org/wiki/xacro' "), None),
        (("</robot>", "<xacro:arm xmlns:xacro='http://ros.org/wiki/xacro'/></robot>"), "run xacro first"),
    ],
)
def test_what_is_wrong_with_a_urdf_file_is_said(tmp_path, change, message):
    before, after = (text.replace("'", '"') for text in change)
    text = TOA.read_text().replace(before, after, 1)
    assert text != TOA.read_text()
    (tmp_path / "mine.urdf").write_text(text)
    if message is None:
        assert read_urdf(tmp_path / "mine.urdf") == text
        return
    with pytest.raises(RobotError, match=re.escape(message)):
        read_urdf(tmp_path / "mine.urdf")


def changed(tmp_path: Path, change) -> Robot:
    """Toa with a changed YAML file."""
    description = yaml.safe_load(TOA.with_suffix(".yaml").read_text())
    change(description)
    (tmp_path / "toa.urdf").write_text(TOA.read_text())
    (tmp_path / "mine.yaml").write_text(yaml.safe_dump(description))
    return load_robot(str(tmp_path / "mine.yaml"))


def swap_arms(description):
    arms = description["mapping"]
    arms["left_arm"], arms["right_arm"] = arms["right_arm"], arms["left_arm"]


def swap_elbow_and_wrist(description):
    arm = description["mapping"]["left_arm"]
    arm["elbow"], arm["wrist"] = arm["wrist"], arm["elbow"]


def arms_through_the_body(description):
    for joint, angle in (("left_shoulder_roll", 0.0), ("left_upper_arm_yaw", -1.5), ("left_elbow", 1.5)):
        description["joints"][joint]["rest"] = angle


def face_backward(description):
    description["mapping"]["head"]["forward"] = [-1, 0, 0]


def palm_along_the_arm(description):
    description["mapping"]["right_arm"]["palm"] = [0, 0, -1]


def arm_up(description):
    description["joints"]["left_shoulder_pitch"]["rest"] = 2.9


def no_elbow_servo(description):
    del description["joints"]["right_elbow"]


@pytest.mark.parametrize(
    ("mistake", "check", "state", "text"),
    [
        (swap_arms, "left arm", "bad", "other side"),
        (swap_elbow_and_wrist, "left arm", "bad", "left_forearm does not hang on left_hand"),
        (arms_through_the_body, "rest pose", "bad", "collide"),
        (arm_up, "hands at rest", "look", "above the shoulder: left;"),
        (face_backward, "face", "look", "180 degrees"),
        (palm_along_the_arm, "palms", "look", "90 degrees"),
        (no_elbow_servo, "right arm", "look", "held at zero: right_elbow"),
    ],
)
def test_a_mistake_is_found(tmp_path, mistake, check, state, text):
    findings = {finding.check: finding for finding in check_mapping(changed(tmp_path, mistake))}
    assert findings[check].state == state
    assert text in findings[check].text


def test_a_servo_that_cannot_do_it_is_named(tmp_path):
    def slow_and_turned(description):
        description["joints"]["left_elbow"] |= {"model": "XM540-W270", "offset": -2.0}

    problems = " ".join(table_problems(changed(tmp_path, slow_and_turned)))
    assert "left_elbow needs ticks" in problems
    assert "XM540-W270 at no more than 3.1" in problems
