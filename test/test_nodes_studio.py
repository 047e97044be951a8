"""The studio in a real browser: what people do there is heard on the topics, and nobody else gets in."""

import http.client
import math
import re
from urllib.parse import urlsplit

import numpy as np
import pytest
from conftest import command, running, wait_until
from std_msgs.msg import String

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.msg import Word
from gesture_bot.nodes.node import PLAN, stamp
from gesture_bot.retarget.robot import load_robot
from gesture_bot.studio.guard import open_server
from gesture_bot.studio.reaching import Reaching

pytestmark = pytest.mark.live

MARKUP = "<img src=x onerror=\"document.title='caught'\">"


@pytest.fixture
def address(listener, demo_corpus):
    """Where the page of a running graph is."""
    browser = pytest.importorskip("browser", reason="playwright is not installed: pip install playwright")
    if not browser.CHROMIUM:
        pytest.skip("chromium is not installed: apt-get install chromium")
    with running(command("run", "studio:=true", "studio_address:=127.0.0.1:0")) as process:
        found = next(filter(None, (re.search(r"open (http\S+)", line) for line in process.stdout)))
        wait_until(lambda: listener.record.joint_states and listener.record.refined, 60, "the graph to move")
        yield found[1]


def test_two_pages_steer_the_robot_and_agree(listener, address):
    from browser import element, open_pages

    record, robot, said = listener.record, load_robot("toa"), []
    listener.create_subscription(String, "say", lambda message: said.append(message.data), PLAN)
    words = listener.create_publisher(Word, "speech/words", PLAN)

    def owners():
        message = record.owners[-1].message
        return dict(zip(message.joints, message.owners, strict=True))

    def button(page, name):
        return page.get_by_role("button", name=name, exact=True)

    with open_pages(address, 2, (1024, 768), 0.25) as (page, other):
        element(page, "text", "textarea").fill(f"Good morning {MARKUP}")
        button(page, "Speak").click()
        wait_until(lambda: len(record.words) > 1, 30, "the words")
        assert said == [f"Good morning {MARKUP}"]
        assert [heard.message.text for heard in record.words][:2] == ["Good", "morning"]

        message = Word(text=MARKUP, duration=0.3)
        message.header.stamp = stamp(listener.now())
        words.publish(message)
        for one in (page, other):
            one.locator(".studio-strip").get_by_text(MARKUP).wait_for()
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

        page.get_by_role("tab", name="Controls").click()
        end = page.locator(".multi-slider-thumb").first
        end.wait_for()
        box = end.bounding_box()
        page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        page.mouse.down()
        page.wait_for_timeout(300)
        page.mouse.move(box["x"] + 60, box["y"], steps=4)
        page.wait_for_timeout(300)
        page.mouse.up()
        wait_until(lambda: record.states[-1].message.constraints, 20, "the control")
        (constraint,) = record.states[-1].message.constraints
        assert (constraint.quantity, constraint.hand, constraint.bound) == (
            "wrist_height",
            "left",
            "at_least",
        )
        assert constraint.unit == "value"
        button(page, "Free the motion").click()
        wait_until(lambda: not record.states[-1].message.constraints, 20, "no control")

        page.get_by_role("tab", name="Gestures").click()
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
        button(page, "Give back").first.click()
        wait_until(lambda: owners()["left_elbow"] == "gesture", 20, "the elbow to be given back")
        button(page, "Take").first.click()
        wait_until(lambda: "teleop" in owners().values(), 20, "the arm to be taken")

        button(page, "STOP").click()
        wait_until(lambda: set(owners().values()) == {"stop"}, 20, "the stop")
        button(other, "Reset").click()
        wait_until(lambda: "stop" not in owners().values(), 20, "the reset")
        assert "teleop" not in owners().values(), "what was taken is given back by a stop"
        button(page, "Take").last.click()
        wait_until(lambda: "teleop" in owners().values(), 20, "the other arm to be taken")
    wait_until(lambda: "teleop" not in owners().values(), 20, "what nobody can give back to be given back")


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
