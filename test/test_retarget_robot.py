"""A robot's files fit together, or one line says what does not."""

import numpy as np
import pytest
import yaml

from gesture_bot.base.errors import FileFormatError, InvalidValueError, RobotError
from gesture_bot.base.files import config_dir
from gesture_bot.retarget.kinematics import Kinematics
from gesture_bot.retarget.robot import load_robot
from gesture_bot.retarget.solver import DirectionSolver

TOA = config_dir() / "robots" / "toa.yaml"


def changed(folder, urdf=lambda text: text, **sections):
    """The path of a copy of toa with a changed URDF and with YAML keys changed or, by None, taken out."""
    description = yaml.safe_load(TOA.read_text())
    for name, values in sections.items():
        for key, value in values.items():
            description[name].update({key: value})
            if value is None:
                del description[name][key]
    (folder / "mine.yaml").write_text(yaml.safe_dump(description, sort_keys=False))
    (folder / "toa.urdf").write_text(urdf(TOA.with_suffix(".urdf").read_text()))
    return str(folder / "mine.yaml")


def test_toa_has_twelve_joints_at_rest_inside_their_limits():
    robot = load_robot("toa")
    assert len(robot.joints) == len(robot.servos) == 12
    assert len({servo.id for servo in robot.servos}) == 12
    assert tuple(servo.joint for servo in robot.servos) == robot.joints
    assert (robot.limits.lower <= robot.rest).all()
    assert (robot.rest <= robot.limits.upper).all()


def test_toa_is_as_fast_as_its_servos_allow():
    no_load_speed = {"XM430-W350": 46 * 2 * np.pi / 60, "XL430-W250": 61 * 2 * np.pi / 60}
    robot = load_robot("toa")
    for servo, velocity in zip(robot.servos, robot.limits.velocity, strict=True):
        assert velocity < 0.85 * no_load_speed[servo.model]


def test_a_path_is_loaded_and_narrows_the_limits(tmp_path):
    joint = {
        "id": 1,
        "model": "X",
        "direction": -1,
        "offset": 0.5,
        "rest": 0.2,
        "acceleration": 9,
        "upper": 0.4,
    }
    robot = load_robot(changed(tmp_path, joints={"head_pan": joint}))
    pan = robot.joints.index("head_pan")
    assert robot.name == "mine"
    assert (robot.limits.lower[pan], robot.limits.upper[pan]) == (-1.4, 0.4)
    assert (robot.limits.acceleration[pan], robot.servos[pan].offset) == (9, 0.5)


def test_the_mark_is_zero_or_the_limit_next_to_it_or_as_given(tmp_path):
    joints = yaml.safe_load(TOA.read_text())["joints"]
    left, right = joints["left_elbow"], joints["right_elbow"]
    path = changed(
        tmp_path, joints=joints | {"left_elbow": left | {"lower": 0.3}, "right_elbow": right | {"mark": -0.1}}
    )
    marks = {servo.joint: servo.mark for servo in load_robot(path).servos}
    assert (marks["left_elbow"], marks["right_elbow"], marks["head_pan"]) == (0.3, -0.1, 0.0)


def test_unknown_robots_are_told_the_known():
    with pytest.raises(InvalidValueError, match="'nao'; valid: .*toa"):
        load_robot("nao")


def test_a_missing_link_is_named_with_those_there(tmp_path):
    path = changed(tmp_path, mapping={"torso": "chest"})
    with pytest.raises(RobotError, match="'chest'; valid: base_link, torso"):
        load_robot(path)


def test_a_missing_joint_is_named_with_those_there(tmp_path):
    path = changed(tmp_path, urdf=lambda text: text.replace('joint name="left_elbow"', 'joint name="knee"'))
    with pytest.raises(RobotError, match="'left_elbow'; valid: head_pan, .*knee"):
        load_robot(path)


def test_a_servo_for_a_joint_that_is_fixed_is_told_so(tmp_path):
    path = changed(
        tmp_path, urdf=lambda text: text.replace('"head_pan" type="revolute"', '"head_pan" type="fixed"')
    )
    with pytest.raises(RobotError, match="is fixed in the URDF: 'head_pan'; valid: head_tilt"):
        load_robot(path)


@pytest.mark.parametrize("text", ["hello", "<sdf/>"])
def test_what_is_not_urdf_is_refused(tmp_path, text):
    with pytest.raises(RobotError, match="URDF"):
        load_robot(changed(tmp_path, urdf=lambda _: text))


def test_a_urdf_that_is_no_tree_is_refused(tmp_path):
    path = changed(tmp_path, urdf=lambda text: text.replace('parent link="torso"', 'parent link="head"'))
    with pytest.raises(RobotError, match="MuJoCo cannot make a model of the URDF of mine"):
        Kinematics(load_robot(path))


@pytest.mark.parametrize(
    ("sections", "message"),
    [
        ({"bus": {"on_exit": "explode"}}, "bus.on_exit.*rest_then_off.*explode"),
        ({"bus": {"warm_degc": 70.0}}, "warm_degc 70 must be below hot_degc 68"),
        ({"bus": {"watchdog_ms": 30}}, "bus.watchdog_ms.*multiple of 20"),
        ({"mapping": {"torso": None}}, "mapping.torso"),
        ({"joints": {"head_tilt": {"id": 31, "model": "X"}}}, "joints.head_tilt.direction: is required"),
        ({"bus": {"on_fall": "stop"}}, "bus.on_fall: there is no such key .got 'stop'"),
    ],
)
def test_a_value_that_does_not_fit_is_named(tmp_path, sections, message):
    with pytest.raises(FileFormatError, match=message):
        load_robot(changed(tmp_path, **sections))


def test_two_servos_with_one_id_are_refused(tmp_path):
    twin = yaml.safe_load(TOA.read_text())["joints"]["head_pan"]
    with pytest.raises(FileFormatError, match="servo id 31, head_pan and head_tilt"):
        load_robot(changed(tmp_path, joints={"head_tilt": twin}))


def test_a_rest_pose_outside_the_limits_is_refused(tmp_path):
    joint = yaml.safe_load(TOA.read_text())["joints"]["left_elbow"] | {"rest": -0.5}
    with pytest.raises(RobotError, match="rest angle of left_elbow is outside 0 to 2.5 rad: -0.5"):
        load_robot(changed(tmp_path, joints={"left_elbow": joint}))


@pytest.mark.parametrize("limit", [{"lower": -3.0}, {"upper": 3.0}, {"velocity": 100.0}])
def test_a_limit_beyond_the_urdfs_is_refused(tmp_path, limit):
    joint = {"id": 1, "model": "X", "direction": 1, "offset": 0.0, "rest": 0.0, "acceleration": 9, **limit}
    with pytest.raises(RobotError, match=f"{next(iter(limit))} of head_pan may narrow"):
        load_robot(changed(tmp_path, joints={"head_pan": joint}))


def test_a_joint_without_a_range_is_refused(tmp_path):
    path = changed(tmp_path, urdf=lambda text: text.replace(' velocity="5"', "", 1))
    with pytest.raises(RobotError, match="head_pan"):
        load_robot(path)


def test_meshes_and_bare_links_need_not_be_there(tmp_path):
    mesh = '<visual><geometry><mesh filename="package://nowhere/head.stl"/></geometry></visual>'
    glue = '<joint name="glue" type="fixed"><parent link="left_hand"/><child link="tool"/></joint>'
    path = changed(
        tmp_path,
        urdf=lambda text: text.replace('<link name="head">', f'<link name="head">{mesh}').replace(
            "</robot>", f'<link name="tool"/>{glue}</robot>'
        ),
    )
    kinematics = Kinematics(load_robot(path))
    np.testing.assert_allclose(kinematics.position("tool"), kinematics.position("left_hand"))


def test_what_simulators_add_to_a_urdf_is_ignored(tmp_path):
    added = (
        '<transmission name="t"><joint name="left_elbow"/></transmission><gazebo reference="head"/>'
        '<mujoco><compiler meshdir="/nowhere" fusestatic="true"/></mujoco></robot>'
    )
    path = changed(tmp_path, urdf=lambda text: text.replace("</robot>", added))
    np.testing.assert_allclose(Kinematics(load_robot(path)).position("torso"), [0, 0, 0.24])


def test_an_inertia_that_no_body_has_does_not_matter(tmp_path):
    path = changed(
        tmp_path, urdf=lambda text: text.replace('ixz="0" iyy="4.58e-03"', 'ixz="0.02" iyy="4.58e-03"')
    )
    assert Kinematics(load_robot(path)).model.body("torso").inertia.sum() == pytest.approx(0.01385)


def test_an_arm_without_length_is_refused(tmp_path):
    arm = yaml.safe_load(TOA.read_text())["mapping"]["left_arm"] | {"elbow": "left_arm_root"}
    with pytest.raises(RobotError, match="left_upper_arm.*left_arm_root"):
        DirectionSolver(load_robot(changed(tmp_path, mapping={"left_arm": arm})))


def test_positive_angles_move_as_the_urdf_says():
    robot = load_robot("toa")
    kinematics = Kinematics(robot)

    def moved(joint, link, angle=0.3, **others):
        angles = np.array([others.get(name, 0.0) for name in robot.joints])
        kinematics.place(angles)
        before = kinematics.position(link), kinematics.rotation(link)
        angles[robot.joints.index(joint)] += angle
        kinematics.place(angles)
        return kinematics.position(link) - before[0], kinematics.rotation(link)

    for side, outward in (("left", 1), ("right", -1)):
        hand, elbow = f"{side}_hand", {f"{side}_elbow": 1.0}
        assert moved(f"{side}_shoulder_pitch", hand)[0][0] > 0.05
        assert moved(f"{side}_elbow", hand)[0][0] > 0.03
        assert outward * moved(f"{side}_shoulder_roll", hand)[0][1] > 0.05
        assert outward * moved(f"{side}_upper_arm_yaw", hand, **elbow)[0][1] > 0.03
        palm = np.array([0, -outward, 0])
        np.testing.assert_allclose(moved(f"{side}_wrist", hand, np.pi / 2)[1] @ palm, [1, 0, 0], atol=1e-9)
    assert (moved("head_pan", "head")[1] @ [1, 0, 0])[1] > 0.2
    assert (moved("head_tilt", "head")[1] @ [1, 0, 0])[2] < -0.2


def test_toa_is_drawn_with_its_left_hand_on_the_left():
    robot = load_robot("toa")
    kinematics = Kinematics(robot)
    assert {shape.kind for shape in kinematics.shapes()} == {"box", "cylinder", "sphere"}
    assert kinematics.position("left_hand")[1] > 0.1
    assert kinematics.position("right_hand")[1] < -0.1
    assert np.isfinite(kinematics.segments()).all()
