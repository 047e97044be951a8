"""The page as a whole: what stands where, and how it follows the graph."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from html import escape

import numpy as np
import viser

from gesture_bot.matching.controls import Controls, Demand
from gesture_bot.matching.emotions import Emotion
from gesture_bot.retarget.robot import Robot
from gesture_bot.studio import controls as control_sliders
from gesture_bot.studio import feelings, gestures, strip, tables
from gesture_bot.studio.arms import Arms
from gesture_bot.studio.controls import ControlSliders
from gesture_bot.studio.events import Events
from gesture_bot.studio.feelings import Feelings
from gesture_bot.studio.figures import Figure
from gesture_bot.studio.gestures import GestureButtons
from gesture_bot.studio.meshes import load_meshes
from gesture_bot.studio.scene import RobotView
from gesture_bot.studio.steering import Steering
from gesture_bot.studio.strip import Strip
from gesture_bot.studio.tables import Facts

RATE = 12.5
"""Pictures a second."""

EVERY_SLIDERS, EVERY_STRIP, EVERY_FACTS = 3, 5, 12
"""So many pictures apart each is renewed. The strip moves on by itself in between."""

LEFT, RIGHT, GAP = 262, 330, 10
"""Widths of the docked panels, and the gap around the floating ones [pixels]."""

CHOSEN, REFINED, TARGET = (150, 158, 168), (41, 155, 166), (240, 140, 60)
"""Colors of the chosen keypoints, the refined ones, and the target of the retargeting."""

BRAND = (41, 155, 166)

STYLE = f"""
body:not(.studio-heard) {{ cursor: progress; }}
body:not(.studio-heard) * {{ pointer-events: none !important; }}
[data-floating-window]:has(.studio-strip) {{ left: {LEFT + GAP}px !important;
  width: calc(100% - {LEFT + RIGHT + 2 * GAP}px) !important; }}
[data-floating-window]:has(.studio-stop) {{ background: none; box-shadow: none; width: 210px !important;
  left: calc(50% + {(LEFT - RIGHT) // 2 - 105}px) !important; }}
[data-floating-window]:has(.studio-stop) [data-dock-griphandle],
[data-floating-window]:has(.studio-stop) [data-dock-strip],
[data-floating-window]:has(.studio-stop) [data-dock-resize] {{ display: none !important; }}
[data-floating-window]:has(.studio-stop) button {{ height: 46px !important;
  font-size: 19px; font-weight: 700; }}
.mantine-Tabs-root:has(.studio-stop):not([data-floating-window] *) {{ position: fixed; z-index: 20;
  top: {GAP}px; left: calc(50% - 105px); width: 210px; }}
.mantine-Tabs-root:has(.studio-stop):not([data-floating-window] *) > [aria-expanded] {{
  display: none !important; }}
div:has(> .studio-banner) {{ text-align: center; }}
.studio-banner {{ display: inline-block; margin: 4px 0; padding: 3px 10px; border-radius: 4px;
  background: #fff0f0; color: #c92a2a; font-weight: 600; font-size: 13px; }}
.studio-said {{ padding: 0 10px 6px; font-size: 12px; color: #c92a2a; }}
.mantine-Notifications-root {{ top: 160px !important; }}
"""

_HEARD = "document.body.classList.add('studio-heard');"
"""Lets a page take clicks: viser drops what is clicked before it knows the page, a stop, too."""

# viser turns the camera by the arrow keys, also while these move a slider or choose a tab.
_START = f"""
setTimeout(() => {{ {_HEARD} }}, 5000);
document.body.onkeydown = event => {{
  const moves = event.target.matches('[role=slider], [role=tab]');
  if (moves && event.key.startsWith('Arrow')) event.stopPropagation();
}};
"""


class Page:
    """One page for all browsers: what one of them changes, the others show.

    Args:
        server: The page's server.
        robot: Which is seen.
        emotions: Every emotion.
        controls: Of the database.
        steering: Passes on what people do.

    Attributes:
        strip: The time strip, to be told what comes.
        facts: What is known of the graph, to be kept up to date.
        expression: The emotion in force; empty until that is heard.
        demands: The constraints on the motion in force; None until that is heard.
        gestures: The buttons of the semantic bank.
        bare: Why some links are drawn by simple shapes, in words, by link.
        chosen: The chosen keypoints.
        refined: The refined keypoints.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        robot: Robot,
        emotions: Mapping[str, Emotion],
        controls: Controls,
        steering: Steering,
    ):
        self._server, self._robot, self._steering = server, robot, steering
        self._events, self._ticks = Events(), 0
        self.strip, self.facts, self.expression = Strip(), Facts(), ""
        self.demands: Sequence[Demand] | None = None
        self._said = ""
        server.gui.configure_theme(show_logo=False, show_share_button=False, brand_color=BRAND)
        self._build_scene(server, robot)
        self._build_left(server)
        tabs = self._build_right(server)
        with tabs.add_tab("Speak"):
            self._build_speech(server)
            self._feelings = Feelings(server, emotions, self._events, steering)
        with tabs.add_tab("Controls"):
            self._controls = ControlSliders(server, controls, self._events, steering)
        self.gestures = GestureButtons(server, tabs.add_tab("Gestures"), self._events, steering)
        with tabs.add_tab("Take over"):
            self._arms = Arms(server, robot, self._view, self._events, steering)
        self._build_strip(server)
        self._build_stop(server)
        server.on_client_connect(_hear)

    @property
    def browsers(self) -> int:
        """How many browsers show it."""
        return len(self._server.get_clients())

    def deal(self) -> None:
        """Do what people asked for since the last time, and tell them what went wrong."""
        if self._events.waiting:
            self._said = self._events.deal()
            self._trouble.content = (
                f'<div class="studio-said">{escape(self._said)}</div>' if self._said else ""
            )

    def show(
        self, now: float, measured: np.ndarray, goals: np.ndarray, target: Callable[[], np.ndarray]
    ) -> None:
        """Bring the page up to date, RATE times a second; nothing is sent while no browser shows it.

        Args:
            now: [s since the epoch].
            measured: (j,) where the joints are [rad]; NaN where that is not known.
            goals: (j,) where those that are taken on this page are sent [rad]; NaN for others.
            target: Tells (j,) where the retargeting wants them now [rad].
        """
        if not self.browsers:
            return
        self._ticks += 1
        with self._server.atomic():
            self._view.show(measured)
            if self._ghost.root.visible:
                self._ghost.show(target())
            self.chosen.show(now)
            self.refined.show(now)
            if self._ticks % EVERY_SLIDERS == 0:
                self._arms.show(measured, goals)
                self._feelings.show(self.expression)
                if self.demands is not None:
                    self._controls.show(self.demands)
                self._show_stop()
            if self._ticks % EVERY_STRIP == 0:
                self._strip.content = self.strip.html(now)
            if self._ticks % EVERY_FACTS == 0:
                self._table.content = self.facts.html(self._robot.joints)

    def _build_scene(self, server: viser.ViserServer, robot: Robot) -> None:
        meshes = load_meshes(robot)
        self.bare = meshes.troubles
        self._view = RobotView(server, "/robot", robot, meshes)
        self._ghost = RobotView(server, "/target", robot, meshes, ghost=TARGET)
        self._ghost.root.visible = False
        size = self._view.height
        server.scene.world_axes.visible = False
        server.scene.add_grid(
            "/floor", width=8 * size, height=8 * size, cell_size=size / 4, section_size=size,
            position=(0.0, 0.0, self._view.floor), cell_color=(225, 230, 235), section_color=(205, 212, 219),
        )  # fmt: skip
        server.initial_camera.position, server.initial_camera.look_at = self._view.camera
        middle = self._view.floor + 0.45 * size
        self.chosen, self.refined = (
            Figure(server, name, color, (-0.2 * size, side * size, middle), 0.65 * size)
            for name, color, side in (("/chosen", CHOSEN, -0.85), ("/refined", REFINED, 0.85))
        )

    def _build_left(self, server: viser.ViserServer) -> None:
        panel = server.gui.add_panel()
        with panel.add_tab("Robot"):
            for label, thing in (
                ("chosen pose", self.chosen.root),
                ("refined pose", self.refined.root),
                ("robot's target", self._ghost.root),
            ):
                box = server.gui.add_checkbox(label, False)
                box.on_update(self._events.on(label, partial(setattr, thing, "visible")))
            self._table = server.gui.add_html("")
        panel.dock_left()
        panel.set_width(LEFT)

    def _build_right(self, server: viser.ViserServer) -> viser.GuiTabGroupHandle:
        server.gui.main_panel.dock_right()
        server.gui.main_panel.set_width(RIGHT)
        self._trouble = server.gui.add_html("")
        return server.gui.add_tab_group()

    def _build_speech(self, server: viser.ViserServer) -> None:
        self._text = server.gui.add_text("text", "Hello, I am glad to see you.", multiline=True)
        speak = server.gui.add_button("Speak", icon=viser.Icon.MESSAGE_CIRCLE)
        speak.on_click(self._events.on("say", lambda _value: self._say()))

    def _build_strip(self, server: viser.ViserServer) -> None:
        panel = server.gui.add_panel()
        with panel.add_tab("Time"):
            self._strip = server.gui.add_html(self.strip.html(0.0))
        panel.float(x=GAP, y=-GAP, width=500, height=strip.HEIGHT + 66)

    def _build_stop(self, server: viser.ViserServer) -> None:
        panel = server.gui.add_panel()
        with panel.add_tab("Stop"):
            styles = STYLE, strip.STYLE, tables.STYLE, feelings.STYLE, control_sliders.STYLE, gestures.STYLE
            server.gui.add_html(
                f'<div class="studio-stop"></div><style onload="{escape(_START)}">{"".join(styles)}</style>'
            )
            stop = server.gui.add_button("STOP", color="red", icon=viser.Icon.HAND_STOP)
            self._stopped = server.gui.add_html(
                '<div class="studio-banner">stopped until reset</div>', visible=False
            )
            self._reset = server.gui.add_button("Reset", color="gray", visible=False)
        panel.float(x=GAP, y=GAP, width=210)
        panel.expand()  # on a phone it is a section below all others, which would be folded
        key = server.gui.add_command("Stop the robot", hotkey="escape", icon=viser.Icon.HAND_STOP)

        @stop.on_click
        async def _(_event: object) -> None:
            self._steering.stop()

        @key.on_trigger
        async def _(_event: object) -> None:
            self._steering.stop()

        self._reset.on_click(self._events.on("reset", lambda _value: self._steering.reset()))

    def _show_stop(self) -> None:
        self._stopped.visible = self._reset.visible = "stop" in self.facts.owners.values()

    def _say(self) -> None:
        if text := self._text.value.strip():
            self._steering.say(text)


async def _hear(client: viser.ClientHandle) -> None:
    """Let a page take clicks that viser knows now."""
    client.gui.add_html(f'<style onload="{escape(_HEARD)}"></style>')
