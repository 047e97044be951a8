"""What `gesture-bot teleop` shows, and what its keys do."""

import math

import numpy as np
from rich.bar import Bar
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from gesture_bot.base.errors import GestureBotError
from gesture_bot.cli.poses import Poses
from gesture_bot.nodes.terminal_teleop import TerminalTeleop
from gesture_bot.retarget.robot import Robot

STEPS = {"left": -1.0, "right": 1.0, "shift-left": -10.0, "shift-right": 10.0, ",": -10.0, ".": 10.0}
"""How far a key moves a joint [degrees]."""

BAR = 16
"""Width of a bar, in characters."""

OTHER_LINES = 11
"""Lines of the screen that show no joint."""

HELP = (
    "↑ ↓ choose   ← → move by 1°, or choose a pose   , . by 10°   enter go to pose\n"
    "g give it back   space stop   r reset   q give all back and end"
)


class Panel:
    """A row for each joint, and for each part of the robot that can be posed.

    Args:
        robot: Which.
        operator: Who moves it.

    Attributes:
        running: True until somebody presses `q`.
    """

    def __init__(self, robot: Robot, operator: TerminalTeleop):
        self.running = True
        self._robot, self._operator, self._jog = robot, operator, operator.jog
        self._poses = Poses(robot)
        self._pose = dict.fromkeys(self._poses.parts, 0)
        self._rows = (*robot.joints, *self._poses.parts)
        self._row = 0
        self._said = ""

    def press(self, key: str) -> None:
        """Do what a key means; what cannot be done is said in the picture."""
        row, self._said = self._rows[self._row], ""
        try:
            if key in ("up", "down"):
                self._row = (self._row + (1 if key == "down" else -1)) % len(self._rows)
            elif key == "space":
                self._operator.stop()
            elif key == "r" and not self._operator.reset():
                self._said = "nobody offers the service `reset`"
            elif key == "g":
                self._jog.give_back(self._joints(row))
            elif key == "q":
                self._operator.give_all_back()
                self.running = False
            elif key in STEPS and row in self._pose:
                turned = self._pose[row] + (1 if STEPS[key] > 0 else -1)
                self._pose[row] = turned % len(self._poses.names)
            elif key in STEPS or (key == "enter" and row in self._pose):
                self._move(row, key)
        except GestureBotError as error:
            self._said = str(error)

    def _move(self, row: str, key: str) -> None:
        if self._operator.stopped:
            raise GestureBotError("the robot is stopped: r lets it move again")
        if row in self._pose:
            name, present = self._poses.names[self._pose[row]], self._operator.measured
            angles = self._poses.angles(name, row, present)
            self._operator.take(angles)
            self._jog.go(angles)
        else:
            self._operator.take([row])
            goal = self._jog.goals[self._robot.joints.index(row)]
            self._jog.go({row: goal + math.radians(STEPS[key])})

    def _joints(self, row: str) -> tuple[str, ...]:
        return self._poses.parts.get(row, (row,))

    def picture(self, height: int) -> RenderableType:
        """The joints and poses, as many as a screen of some lines can show."""
        return Group(
            self._joint_table(max(3, height - OTHER_LINES)),
            Text(),
            self._pose_table(),
            Text(),
            self._state(),
            HELP,
        )

    def _joint_table(self, shown: int) -> Table:
        table = Table(box=None, pad_edge=False)
        table.add_column("joint", no_wrap=True)
        for title in ("is at", "goal", "from"):
            table.add_column(title, justify="right", no_wrap=True, min_width=6)
        table.add_column("", width=BAR)
        table.add_column("to", justify="right", no_wrap=True)
        table.add_column("owner", no_wrap=True)
        joints, limits = self._robot.joints, self._robot.limits
        first = min(max(self._row - shown // 2, 0), max(len(joints) - shown, 0))
        measured, goals = self._operator.measured, self._jog.goals
        for column in range(first, min(first + shown, len(joints))):
            lower, upper = limits.lower[column], limits.upper[column]
            place = np.clip((measured[column] - lower) / (upper - lower), 0.5 / BAR, 1 - 0.5 / BAR)
            bar = Bar(1.0, place - 0.5 / BAR, place + 0.5 / BAR, width=BAR, color="cyan", bgcolor="grey30")
            table.add_row(
                joints[column],
                _degrees(measured[column]),
                _degrees(goals[column]),
                _degrees(lower),
                "" if np.isnan(place) else bar,
                _degrees(upper),
                self._owner(joints[column]),
                style="reverse" if column == self._row else None,
            )
        return table

    def _pose_table(self) -> Table:
        table = Table.grid(padding=(0, 2))
        for place, (part, number) in enumerate(self._pose.items(), len(self._robot.joints)):
            style = "reverse" if place == self._row else None
            table.add_row(part, f"‹ {self._poses.names[number]} ›", style=style)
        return table

    def _owner(self, joint: str) -> Text:
        owner = self._operator.owners.get(joint, "")
        return Text(owner, {"stop": "bold red", "teleop": "bold green"}.get(owner, ""))

    def _state(self) -> Text:
        if self._said:
            return Text(self._said, "red")
        if self._operator.stopped:
            return Text("STOPPED: r lets the robot move again", "bold red")
        if np.isnan(self._operator.measured).all():
            return Text("no joint states any more: has the graph ended?", "red")
        taken = len(self._jog.taken)
        return Text(
            f"{taken} of {len(self._robot.joints)} joints are yours" if taken else "no joint is yours"
        )


def _degrees(angle: np.floating) -> str:
    return "" if math.isnan(angle) else f"{math.degrees(angle):z.1f}°"
