"""The studio in a real browser: what people do there is heard on the topics, and nobody else gets in."""

import http.client
import math
import re
import shutil
from urllib.parse import urlsplit

import numpy as np
import pytest
import trimesh
from conftest import command, running, wait_until
from std_msgs.msg import String

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.files import config_dir
from gesture_bot.msg import Constraint, Control, Emotion, Word
from gesture_bot.nodes.node import PLAN, STATE, stamp
from gesture_bot.retarget.kinematics import Kinematics
from gesture_bot.retarget.robot import load_robot
from gesture_bot.studio.arms import HANDLE
from gesture_bot.studio.guard import open_server
from gesture_bot.studio.meshes import FACES, Meshes, load_meshes
from gesture_bot.studio.reaching import Reaching
from gesture_bot.studio.scene import RobotView
from gesture_bot.studio.strip import Strip

pytestmark = pytest.mark.live

STATES = (Control, "control"), (Emotion, "emotion")

RAISED = np.array([0.0, 0.0, 0.08])
"""How far the wrist is dragged [m]."""

BANK = """
gestures:
  over_the_hills:
    triggers: [over the hills]
    keyframes:
      - {time: 0.0, right: open}
"""

MARKUP = "<img src=x onerror=\"document.title='caught'\">"


@pytest.fixture
def address(listener, demo_corpus, tmp_path):
    """Where the page of a running graph is."""
    browser = pytest.importorskip("browser", reason="playwright is not installed: pip install playwright")
    if not browser.CHROMIUM:
        pytest.skip("chromium is not installed: apt-get install chromium")
    shutil.copytree(config_dir() / "banks", tmp_path / "banks")
    settings = "studio:=true", "studio_address:=127.0.0.1:0", f"banks:={tmp_path / 'banks'}"
    with running(command("run", *settings)) as process:
        found = next(filter(None, (re.search(r"open (http\S+)", line) for line in process.stdout)))
        wait_until(lambda: listener.record.joint_states and listener.record.refined, 60, "the graph to move")
        yield found[1]


class Camera:
    """What a page's camera sees, until somebody turns it."""

    def __init__(self, robot, page):
        server, _ = open_server("127.0.0.1:0")
        self.view = RobotView(server, "/robot", robot, Meshes())
        self._fov = server.initial_camera.fov
        server.stop()
        self._box = page.locator("canvas").first.bounding_box()

    def pixel(self, point):
        """Where a point in the robot's base frame is seen."""
        position, look_at = map(np.array, self.view.camera)
        forward = (look_at - position) / np.linalg.norm(look_at - position)
        right = np.cross(forward, [0, 0, 1])
        right /= np.linalg.norm(right)
        seen = self.view.turn @ point - position
        focal = self._box["height"] / 2 / math.tan(self._fov / 2)
        x, y = (focal * (seen @ axis) / (seen @ forward) for axis in (right, np.cross(forward, right)))
        return self._box["x"] + self._box["width"] / 2 + x, self._box["y"] + self._box["height"] / 2 + y


def center(element):
    """The middle of an element."""
    box = element.bounding_box()
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def drag(page, slider, pixels):
    """Drag the thumb of a slider to the right; where it is then."""
    x, y = center(slider)
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + pixels, y, steps=4)
    page.mouse.up()
    return x + pixels, y


def touch(page, place, pixels):
    """Drag a finger to the right."""
    session = page.context.new_cdp_session(page)
    x, y = place
    for kind, points in (
        ("touchStart", [{"x": x, "y": y}]),
        *(("touchMove", [{"x": x + pixels * step / 4, "y": y}]) for step in range(1, 5)),
        ("touchEnd", []),
    ):
        session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})


def test_two_pages_steer_the_robot_and_agree(listener, address, tmp_path):
    from browser import element, open_pages

    record, robot, said = listener.record, load_robot("toa"), []
    listener.create_subscription(String, "say", lambda message: said.append(message.data), PLAN)
    words = listener.create_publisher(Word, "speech/words", PLAN)
    controls, emotions = (listener.create_publisher(*topic, STATE) for topic in STATES)
    asked = []
    for topic in STATES:
        listener.create_subscription(*topic, asked.append, STATE)

    def owners():
        message = record.owners[-1].message
        return dict(zip(message.joints, message.owners, strict=True))

    def button(page, name):
        return page.get_by_role("button", name=name, exact=True)

    def bound():
        (constraint,) = record.states[-1].message.constraints
        return constraint.quantity, constraint.hand, constraint.bound, constraint.unit

    with open_pages(address, 2, (1024, 768), sparing=True) as (page, other):
        element(page, "text", "textarea").fill(f"Good morning {MARKUP}")
        button(page, "Speak").click()
        wait_until(lambda: len(record.words) > 1, 30, "the words")
        assert said == [f"Good morning {MARKUP}"]
        assert [heard.message.text for heard in record.words][:2] == ["Good", "morning"]

        def shows_word(one):
            """The strip shows the last seconds alone: said again, until the page comes to draw it."""
            message = Word(text=MARKUP, duration=0.3)
            message.header.stamp = stamp(listener.now())
            words.publish(message)
            one.wait_for_timeout(1000)
            return one.locator(".studio-strip").get_by_text(MARKUP).count()

        for one in (page, other):
            wait_until(lambda one=one: shows_word(one), 60, "the word")
            assert one.title() != "caught"
            assert not one.locator("img[src=x]").count()

        element(page, "emotion").click()
        page.get_by_role("option", name="sad", exact=True).click()
        wait_until(lambda: record.states[-1].message.expression == "sad", 20, "the emotion of the list")
        pad = page.locator(".studio-pad")
        pad.locator(".felt").get_by_text("sad").wait_for()
        box = pad.bounding_box()
        page.mouse.click(box["x"] + 0.8 * box["width"], box["y"] + 0.15 * box["height"])
        wait_until(lambda: record.states[-1].message.expression == "excited", 20, "the emotion of the pad")
        other.wait_for_function(
            "() => [...document.querySelectorAll('input')].some(input => input.value === 'excited')"
        )

        for one in (page, other):
            one.get_by_role("tab", name="Controls").click()
        lowest = page.get_by_role("slider").first
        lowest.press("ArrowRight", delay=500)  # held, it must not turn the camera: later a wrist is aimed at
        wait_until(lambda: record.states[-1].message.constraints, 20, "the control by keys")
        assert bound() == ("wrist_height", "left", "at_least", "value")
        before = record.states[-1].message.constraints[0].value
        middle = drag(page, lowest, 60)
        wait_until(lambda: record.states[-1].message.constraints[0].value > before + 0.1, 20, "the control")
        assert bound() == ("wrist_height", "left", "at_least", "value")
        before = record.states[-1].message.constraints[0].value
        touch(page, middle, -40)
        wait_until(lambda: abs(center(lowest)[0] - middle[0] + 40) < 3, 20, "the thumb to be at the finger")
        wait_until(lambda: record.states[-1].message.constraints[0].value < before - 0.05, 20, "the touch")
        range_told = other.locator(".studio-range").first
        wait_until(
            lambda: f"≥ {record.states[-1].message.constraints[0].value:.2f} m" in range_told.inner_text(),
            20,
            "the other page to tell the control",
        )
        button(page, "Free the motion").click()
        wait_until(lambda: not record.states[-1].message.constraints, 20, "no control")
        wait_until(lambda: isinstance(asked[-1], Control) and not asked[-1].constraints, 20, "what was asked")

        asked.clear()
        emotions.publish(Emotion(expression="angry"))
        controls.publish(Control(constraints=[Constraint(quantity="wrist_height", value=70.0)]))
        for one in (page, other):
            for side in ("left", "right"):
                row = one.locator(".studio-range", has_text=f"wrist height, {side}")
                row.get_by_text("(percentile").wait_for()
            one.locator(".studio-pad .felt", has_text="angry").wait_for(state="attached")
        controls.publish(Control())

        page.get_by_role("tab", name="Gestures").click()
        (tmp_path / "banks" / "mine.yaml").write_text(BANK)
        button(page, "over the hills").wait_for()
        page.wait_for_timeout(1000)  # the selector looks at its bank once a second, as the page does
        button(page, "over the hills").click()
        wait_until(
            lambda: "over_the_hills" in [heard.message.name for heard in record.selected], 20, "the new one"
        )
        (tmp_path / "banks" / "mine.yaml").unlink()
        button(page, "over the hills").wait_for(state="detached")
        assert len(asked) == 3, f"what others ask for is shown, not asked for again: {asked}"
        button(page, "thanks").click()
        wait_until(lambda: "thanks" in [heard.message.name for heard in record.selected], 20, "the gesture")

        page.get_by_role("tab", name="Take over").click()
        button(page, "Take").first.click()
        wait_until(lambda: "teleop" in owners().values(), 20, "the arm to be taken")
        element(page, "elbow [°]").fill("80")
        column = robot.joints.index("left_elbow")
        wait_until(lambda: owners()["left_elbow"] == "teleop", 20, "the elbow to be taken")
        assert owners()["right_elbow"] != "teleop"
        reached = math.radians(80)
        wait_until(
            lambda: abs(record.joint_states[-1].message.position[column] - reached) < 0.05, 20, "the elbow"
        )

        def angles():
            return np.array(record.joint_states[-1].message.position)

        element(page, "drag wrists").click()
        reaching, camera = Reaching(robot, "left"), Camera(robot, page)
        page.wait_for_timeout(2000)  # the arrows are not there at once
        start = reaching.wrist(angles())
        grip = start + [0, 0, 0.6 * HANDLE * camera.view.height]
        page.mouse.move(*camera.pixel(grip))
        page.mouse.down()
        page.mouse.move(*camera.pixel(grip + RAISED), steps=5)
        wait_until(
            lambda: np.linalg.norm(reaching.wrist(angles()) - start - RAISED) < 0.025, 30, "the wrist to rise"
        )
        page.mouse.up()
        assert (angles() >= robot.limits.lower - 0.01).all() and (angles() <= robot.limits.upper + 0.01).all()
        assert owners()["right_elbow"] != "teleop"

        button(page, "Give back").first.click()
        wait_until(lambda: owners()["left_elbow"] == "gesture", 20, "the elbow to be given back")
        button(page, "Take").first.click()
        wait_until(lambda: "teleop" in owners().values(), 20, "the arm to be taken")

        for stopping, resetting in ((page, other), (other, page)):
            button(stopping, "STOP").click()
            wait_until(lambda: set(owners().values()) == {"stop"}, 20, "the stop")
            button(resetting, "Reset").click()
            wait_until(lambda: "stop" not in owners().values(), 20, "the reset")
            assert "teleop" not in owners().values(), "what was taken is given back by a stop"
            other.set_viewport_size({"width": 400, "height": 800})  # as a phone
        page.get_by_text("stopped until reset").wait_for(state="hidden")
        button(page, "Take").last.click()
        wait_until(lambda: "teleop" in owners().values(), 20, "the other arm to be taken")
    wait_until(lambda: "teleop" not in owners().values(), 20, "what nobody can give back to be given back")


def test_no_word_of_the_strip_covers_another():
    drawn = Strip()
    for number, text in enumerate(["extraordinarily", "I", "am", "glad"]):
        drawn.add_word("voice", 1, 0.2 * number, 0.2, text)
    shape = r'<svg x="([^"]*)%" y="(\d+)"[^>]*calc\(([^%]*)% - 3px\)"[^>]*><text [^>]*"word">(\w+)<'
    boxes = {word: tuple(map(float, box)) for *box, word in re.findall(shape, drawn.html(1.0))}
    assert set(boxes) == {"extraordinarily", "I", "am", "glad"}
    long, glad = boxes["extraordinarily"], boxes["glad"]
    assert long[1] == glad[1] and long[0] + long[2] == pytest.approx(glad[0])
    assert len({line for _, line, _ in boxes.values()}) == 3
    assert 'class="word' not in drawn.html(60.0)


def test_only_this_machine_or_the_token_gets_in():
    def status(path="/", page=True, **headers):
        connection = http.client.HTTPConnection("127.0.0.1", port, timeout=5)
        upgrade = {
            "Connection": "Upgrade", "Upgrade": "websocket", "Sec-WebSocket-Version": "13",
            "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
        }  # fmt: skip
        connection.request("GET", path, headers=headers if page else upgrade | headers)
        answer = connection.getresponse()
        connection.close()
        return answer.status, answer.getheader("Set-Cookie", "").partition(";")[0]

    server, address = open_server("127.0.0.1:0")
    port = server.get_port()
    assert address == f"http://127.0.0.1:{port}/"
    assert status()[0] == 200
    assert status(page=False)[0] == status(page=False, Origin=f"http://127.0.0.1:{port}")[0] == 101
    assert status(page=False, Origin="http://evil.example")[0] == 403, "another web site must not steer"
    assert status(page=False, Host="evil.example")[0] == status(Host="evil.example")[0] == 403
    assert server.request_share_url() is None
    server.stop()

    server, address = open_server("0.0.0.0:0")
    port, token = server.get_port(), urlsplit(address).query
    assert re.fullmatch(r"token=[\w-]{32}", token)
    for path in ("/", "/?token=", "/?token=guessed"):
        assert status(path)[0] == status(path, page=False)[0] == 401
    assert status(page=False, Cookie="studio_token=guessed")[0] == 401
    code, cookie = status(f"/?{token}")
    assert code == 303
    assert status(Cookie=cookie)[0] == 200
    assert status(page=False, Cookie=cookie)[0] == 101
    assert status(page=False, Cookie=cookie, Origin="http://evil.example")[0] == 403
    server.stop()

    with pytest.raises(InvalidValueError, match="192.0.2.1:80"):
        open_server("192.0.2.1:80")


def test_a_dragged_wrist_is_reached_inside_the_limits():
    robot = load_robot("toa")
    for side in ("left", "right"):
        reaching = Reaching(robot, side)
        start = reaching.wrist(robot.rest)
        for way in ([0.1, 0.0, 0.1], [0.05, 0.02, 0.2]):
            angles = robot.rest.copy()
            found = reaching.solve(start + way, robot.rest)
            columns = [robot.joints.index(joint) for joint in found]
            angles[columns] = list(found.values())
            assert np.linalg.norm(reaching.wrist(angles) - start - way) < 0.01
            assert (angles >= robot.limits.lower).all() and (angles <= robot.limits.upper).all()
            assert len(found) == 5, "the other arm stays"


def test_a_robot_looks_like_its_meshes_and_like_simple_shapes_without(tmp_path):
    robots, looks = tmp_path / "looks" / "robots", tmp_path / "looks" / "meshes"
    shutil.copytree(config_dir() / "robots", robots)
    looks.mkdir()
    fine = trimesh.creation.icosphere(subdivisions=6)
    assert len(fine.faces) > FACES
    fine.export(looks / "ball.stl")
    ball = '<mesh filename="package://looks/meshes/ball.stl" scale="0.05 0.05 0.4"/>'
    lost = '<mesh filename="package://looks/meshes/lost.stl"/>'
    urdf = (robots / "toa.urdf").read_text()
    for simple, mesh in (
        ('<origin xyz="0 0 0.02"/><geometry><cylinder radius="0.022" length="0.05"/>', ball),
        ('<origin xyz="0 0 -0.03"/><geometry><box size="0.046 0.018 0.05"/>', lost),
    ):
        assert simple in urdf
        origin, _, _ = simple.partition("<geometry>")
        urdf = urdf.replace(simple, f"{origin}<geometry>{mesh}")
    (robots / "toa.urdf").write_text(urdf)

    robot = load_robot(str(robots / "toa.yaml"))
    meshes = load_meshes(robot)
    assert set(meshes.troubles) == {"left_hand", "right_hand"}
    assert "lost.stl" in meshes.troubles["left_hand"]
    ((link, (neck,)),) = meshes.links.items()
    assert link == "neck"
    assert len(neck.faces) <= FACES
    np.testing.assert_allclose(neck.bounds, [[-0.05, -0.05, -0.38], [0.05, 0.05, 0.42]], atol=2e-3)
    color = neck.visual.material.main_color[:3].astype(int)
    np.testing.assert_allclose(color, [51, 56, 64], atol=1, err_msg="the URDF's dark")

    kinematics = Kinematics(robot)
    assert len(kinematics.shapes(meshes.links)) == len(kinematics.shapes()) - 1, "nothing stands for the neck"
    server, _ = open_server("127.0.0.1:0")
    plain = RobotView(server, "/plain", load_robot("toa"), Meshes())
    view = RobotView(server, "/robot", robot, meshes)
    server.stop()
    assert view.height > plain.height + 0.1, "the mesh is higher than the head"
