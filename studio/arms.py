"""Taking over: each joint by a slider, each wrist by dragging it; what nobody takes goes on gesturing."""

import math
from functools import partial
from typing import Any

import numpy as np
import viser

from gesture_bot.retarget.kinematics import arm_joints
from gesture_bot.retarget.robot import Robot
from gesture_bot.studio.events import Events
from gesture_bot.studio.reaching import Reaching
from gesture_bot.studio.scene import RobotView
from gesture_bot.studio.steering import Steering

HANDLE = 0.28
"""Size of the arrows at a wrist, by the robot's height."""


class Arms:
    """The elements with which people take joints, move them and give them back.

    Args:
        server: The page's server.
        robot: Which.
        view: Of the robot, in whose scene the wrists are dragged.
        events: Takes in what people do.
        steering: Passes it on.
    """

    def __init__(
        self, server: viser.ViserServer, robot: Robot, view: RobotView, events: Events, steering: Steering
    ):
        self._robot, self._steering = robot, steering
        self._measured = np.full(len(robot.joints), np.nan)
        self._sliders: dict[str, viser.GuiSliderHandle[float]] = {}
        arms = arm_joints(robot)
        others = tuple(joint for joint in robot.joints if joint not in (*arms["left"], *arms["right"]))
        handles = server.gui.add_checkbox("drag wrists", False, hint="Arrows at the wrists, to drag them by")
        for part, joints in (
            ("left arm", arms["left"]),
            ("right arm", arms["right"]),
            ("other joints", others),
        ):
            if joints:
                with server.gui.add_folder(part, expand_by_default=part != "other joints"):
                    self._add_part(server, part, joints, events)
        self._wrists = {
            side: _Wrist(server, robot, side, view, events, steering) for side in ("left", "right")
        }
        handles.on_update(events.on("handles", self._show_handles))

    def show(self, measured: np.ndarray, goals: np.ndarray) -> None:
        """Let sliders and handles follow.

        Args:
            measured: (j,) where the joints are [rad]; NaN where that is not known.
            goals: (j,) where those that are taken on this page are sent [rad]; NaN for others.
        """
        self._measured = measured
        for joint, slider in self._sliders.items():
            column = self._robot.joints.index(joint)
            # The slider of a joint that is taken stays where people put it.
            if math.isnan(goals[column]) and not math.isnan(measured[column]):
                slider.value = round(math.degrees(np.clip(measured[column], *self._limits(joint))))
        for wrist in self._wrists.values():
            wrist.show(measured, goals)

    def _add_part(
        self, server: viser.ViserServer, part: str, joints: tuple[str, ...], events: Events
    ) -> None:
        choice = server.gui.add_button_group(part, ("Take", "Give back"))
        choice.on_click(events.on(part, lambda chosen: self._take(chosen == "Take", joints)))
        for joint in joints:
            lower, upper = self._limits(joint)
            low, high = math.ceil(math.degrees(lower)), math.floor(math.degrees(upper))
            slider = server.gui.add_slider(
                joint.replace("_", " ").removeprefix(part.split()[0] + " ") + " [°]",
                min=low, max=high, step=1, initial_value=min(max(0, low), high),
            )  # fmt: skip
            slider.on_update(events.on(joint, partial(self._go, joint)))
            self._sliders[joint] = slider

    def _take(self, taking: bool, joints: tuple[str, ...]) -> None:
        if taking:
            self._steering.take(joints)
        else:
            self._steering.give_back(joints)

    def _go(self, joint: str, degrees: float) -> None:
        self._steering.go({joint: math.radians(degrees)})

    def _show_handles(self, shown: bool) -> None:
        for wrist in self._wrists.values():
            wrist.handle.visible = shown

    def _limits(self, joint: str) -> tuple[float, float]:
        column = self._robot.joints.index(joint)
        return float(self._robot.limits.lower[column]), float(self._robot.limits.upper[column])


class _Wrist:
    """A wrist with arrows to drag it by. It follows the robot while nobody holds it."""

    def __init__(
        self,
        server: viser.ViserServer,
        robot: Robot,
        side: str,
        view: RobotView,
        events: Events,
        steering: Steering,
    ):
        self._reaching, self._steering = Reaching(robot, side), steering
        self._held = False
        self._from = robot.rest
        self.handle = server.scene.add_transform_controls(
            f"{view.root.name}/{side}_wrist",
            scale=HANDLE * view.height,
            disable_rotations=True,
            depth_test=False,
            position=self._reaching.wrist(robot.rest),
            visible=False,
        )

        @self.handle.on_update
        async def _(event: Any) -> None:
            self._held = event.phase != "end"
            point = np.array(event.target.position)
            events.put(f"{side} wrist", lambda: self._drag(point))

    def show(self, measured: np.ndarray, goals: np.ndarray) -> None:
        """Follow the robot."""
        self._from = np.where(np.isnan(goals), measured, goals)
        if self.handle.visible and not self._held and not np.isnan(measured).any():
            self.handle.position = self._reaching.wrist(measured)

    def _drag(self, point: np.ndarray) -> None:
        if not np.isnan(self._from).any():
            self._steering.go(self._reaching.solve(point, self._from))
