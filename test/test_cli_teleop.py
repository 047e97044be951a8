"""`gesture-bot teleop` in a terminal: a pseudo-terminal, the real mux and a robot that moves."""

import os
import pty
import re
import signal
import subprocess
import termios
import threading
from contextlib import contextmanager, suppress

import numpy as np
import pytest
from conftest import command, wait_until
from moving_robot import MovingRobot, spinning

from gesture_bot.cli.main import main
from gesture_bot.nodes.motion_mux import MotionMux
from gesture_bot.retarget.robot import load_robot

pytestmark = pytest.mark.live

ROBOT = load_robot("toa")
ELBOW = ROBOT.joints.index("left_elbow")
DOWN, RIGHT, LEFT = "\x1b[B", "\x1b[C", "\x1bOD"


class Terminal:
    """A terminal of 80 columns and 30 lines with `gesture-bot teleop` in it."""

    def __init__(self, *arguments):
        self._screen, self._side = pty.openpty()
        termios.tcsetwinsize(self._side, (30, 80))
        self._mode = termios.tcgetattr(self._side)
        self._drawn = b""
        self.process = subprocess.Popen(
            command("teleop", *arguments), stdin=self._side, stdout=self._side, stderr=self._side,
            env={**os.environ, "TERM": "xterm-256color"}, start_new_session=True,
        )  # fmt: skip
        self._reading = threading.Thread(target=self._read)
        self._reading.start()

    def _read(self):
        with suppress(OSError):  # the other side is closed
            while read := os.read(self._screen, 65536):
                self._drawn += read

    def type(self, keys):
        os.write(self._screen, keys.encode())

    def shows(self):
        """The last whole picture, without colours."""
        pictures = re.split(r"\x1b\[H", self._drawn.decode(errors="replace"))
        return re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", pictures[-1])

    def assert_as_before(self):
        assert termios.tcgetattr(self._side) == self._mode
        wait_until(lambda: b"\x1b[?1049l" in self._drawn, 2, "the end of the alternate screen")
        assert self._drawn.rfind(b"\x1b[?25h") > self._drawn.rfind(b"\x1b[?25l"), "the cursor is seen"

    def close(self):
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        os.close(self._side)
        self._reading.join()
        os.close(self._screen)


@contextmanager
def teleop(*arguments):
    terminal = Terminal(*arguments)
    try:
        yield terminal
    finally:
        terminal.close()


@pytest.fixture
def graph(listener):
    with spinning(MovingRobot, MotionMux):
        wait_until(lambda: listener.record.joint_states and listener.record.owners, 10, "the graph")
        yield listener


def owners(node):
    message = node.record.owners[-1].message
    return dict(zip(message.joints, message.owners, strict=True))


def angles(node):
    """(j,) [degrees]."""
    return np.degrees(node.record.joint_states[-1].message.position)


def test_joints_and_poses_are_chosen_moved_stopped_and_given_back(graph):
    rest = np.degrees(ROBOT.rest)
    with teleop() as terminal:
        wait_until(lambda: "no joint is yours" in terminal.shows(), 30, "the picture")
        assert all(joint in terminal.shows() for joint in ROBOT.joints)

        terminal.type(ELBOW * DOWN + ".." + 3 * RIGHT + LEFT)
        wait_until(lambda: angles(graph)[ELBOW] == pytest.approx(rest[ELBOW] + 22, abs=0.1), 5, "the elbow")
        assert [joint for joint, owner in owners(graph).items() if owner == "teleop"] == ["left_elbow"]
        np.testing.assert_allclose(np.delete(angles(graph) - rest, ELBOW), 0, atol=1e-6)
        row = next(line for line in terminal.shows().splitlines() if "left_elbow" in line)
        wait_until(lambda: f"{rest[ELBOW] + 22:.1f}°" in terminal.shows(), 2, "the angle on the screen")
        assert "143.2°" in row and "teleop" in row

        terminal.type((len(ROBOT.joints) - ELBOW + 3) * DOWN + "..")  # the second pose of the right arm
        wait_until(lambda: "right arm    ‹ offer ›" in terminal.shows(), 5, "the pose")
        terminal.type("\r")
        right = [joint for joint in ROBOT.joints if joint.startswith("right_")]
        wait_until(lambda: {owners(graph)[joint] for joint in right} == {"teleop"}, 5, "the right arm")
        elbow = ROBOT.joints.index("right_elbow")
        wait_until(lambda: angles(graph)[elbow] > 80, 5, "the right elbow to bend")

        terminal.type(" ")
        wait_until(lambda: "STOPPED" in terminal.shows(), 5, "the stop")
        assert set(owners(graph).values()) == {"stop"}
        terminal.type("\r")
        wait_until(lambda: "the robot is stopped" in terminal.shows(), 5, "the answer")
        terminal.type("r")
        wait_until(lambda: set(owners(graph).values()) == {"nobody"}, 5, "the reset")
        wait_until(lambda: "no joint is yours" in terminal.shows(), 5, "the reset on the screen")

        terminal.type(".")
        terminal.type("\r")
        wait_until(lambda: "teleop" in owners(graph).values(), 5, "the right arm")
        terminal.type("q")
        assert terminal.process.wait(10) == 0
        terminal.assert_as_before()
    wait_until(lambda: "teleop" not in owners(graph).values(), 2, "all to be given back")


def test_a_terminal_is_as_before_however_it_ends():
    with teleop() as terminal:
        with spinning(MovingRobot, MotionMux):
            wait_until(lambda: "no joint is yours" in terminal.shows(), 30, "the picture")
        wait_until(lambda: "has the graph ended?" in terminal.shows(), 5, "the end of the graph")
        terminal.type(RIGHT)
        wait_until(lambda: "no joint state tells where" in terminal.shows(), 5, "the answer")
        terminal.process.send_signal(signal.SIGTERM)
        assert terminal.process.wait(10) == 128 + signal.SIGTERM
        terminal.assert_as_before()


def test_it_says_that_no_graph_runs():
    with teleop() as terminal:
        assert terminal.process.wait(30) == 1
        wait_until(lambda: "must be running" in terminal.shows(), 2, "the reason")
        assert "no joint of toa is heard on joint_states within 3 s" in " ".join(terminal.shows().split())


def test_it_asks_for_a_terminal(capsys):
    assert main(["teleop"]) == 1
    assert "needs a terminal" in capsys.readouterr().err
