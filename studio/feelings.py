"""How the robot feels: the list of names, and a pad of valence and arousal."""

from collections.abc import Mapping
from html import escape

import viser

from gesture_bot.matching.emotions import Emotion
from gesture_bot.studio.events import Events
from gesture_bot.studio.steering import Steering

SPAN = 1.2
"""Valence and arousal at the border of the pad: names need room around their places."""

ROOM = 14.0, 5.0
"""Names nearer to each other are moved apart, in percent of the pad's width and height."""

# A click becomes numbers in the two inputs below the pad, as if they were typed, so that viser sends them.
_CLICK = """
const box = this.getBoundingClientRect();
const x = (event.clientX - box.left) / box.width, y = (event.clientY - box.top) / box.height;
const values = [2 * x - 1, 1 - 2 * y].map(value => Math.max(-1, Math.min(1, SPAN * value)));
let around = this;
while (around.querySelectorAll('input[inputmode=decimal]').length < 2) around = around.parentElement;
const set = Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, 'value').set;
around.querySelectorAll('input[inputmode=decimal]').forEach((input, i) => {
  set.call(input, values[i].toFixed(2));
  input.dispatchEvent(new Event('input', {bubbles: true}));
});
""".replace("SPAN", str(SPAN))

STYLE = """
.studio-pad { display: block; width: calc(100% - 20px); height: 250px; margin: 0 10px 8px;
  background: #f4f7f9; border: 1px solid #dde3e8; border-radius: 4px; cursor: crosshair; touch-action: none; }
.studio-pad text { font-size: 10px; fill: #55606b; pointer-events: none;
  dominant-baseline: middle; text-anchor: middle; }
.studio-pad .felt { font-weight: bold; }
.studio-pad .axis { fill: #a3adb7; }
"""


class Feelings:
    """The elements that show and set the emotion.

    Args:
        server: The page's server.
        emotions: Every emotion; see emotions.load_emotions.
        events: Takes in what people do.
        steering: Passes it on.
    """

    def __init__(
        self, server: viser.ViserServer, emotions: Mapping[str, Emotion], events: Events, steering: Steering
    ):
        self._emotions, self._events = emotions, events
        self._names = server.gui.add_dropdown("emotion", tuple(emotions), initial_value="neutral")
        self._pad = server.gui.add_html("")
        self._place = server.gui.add_vector2(
            "valence, arousal", (0.0, 0.0), min=(-1, -1), max=(1, 1), step=0.01
        )
        self._names.on_update(events.on("emotion", steering.feel))
        self._place.on_update(events.on("emotion", lambda place: steering.feel("", *place)))
        self._written = _apart(emotions)
        self._heard = ""
        self._shown: object = None

    def show(self, expression: str) -> None:
        """Show the emotion in force, whoever set it: its name, and its place if none means it already."""
        # The one before people asked for another is in force a moment longer: their choice stays meanwhile.
        unchanged, self._heard = expression == self._heard, expression
        if expression not in self._emotions or unchanged and not self._events.settled("emotion"):
            return
        self._names.value = expression
        place = self._place.value
        nearest = min(
            self._emotions.values(),
            key=lambda emotion: (emotion.valence - place[0]) ** 2 + (emotion.arousal - place[1]) ** 2,
        )
        emotion = self._emotions[expression]
        if nearest.name != expression:
            self._place.value = place = (emotion.valence, emotion.arousal)
        if (expression, place) != self._shown:
            self._shown = expression, place
            self._pad.content = self._drawn(expression, *place)

    def _drawn(self, expression: str, valence: float, arousal: float) -> str:
        names = "".join(
            f'<text x="{x:.1f}%" y="{y:.1f}%" class="{"felt" * (name == expression)}">{escape(name)}</text>'
            for name, (x, y) in self._written.items()
        )
        return (
            f'<svg class="studio-pad" onclick="{escape(_CLICK)}">'
            '<line x1="50%" x2="50%" y1="0" y2="100%" stroke="#dde3e8"/>'
            '<line x1="0" x2="100%" y1="50%" y2="50%" stroke="#dde3e8"/>'
            '<text x="91%" y="53%" class="axis">valence</text>'
            '<text x="58%" y="4%" class="axis">arousal</text>'
            f'<circle cx="{_x(valence):.1f}%" cy="{_y(arousal):.1f}%" r="7" fill="#299ba6" opacity="0.75"/>'
            f"{names}</svg>"
        )


def _apart(emotions: Mapping[str, Emotion]) -> dict[str, tuple[float, float]]:
    """Where each name is written [percent of the pad]: at its place, or below those that are in the way."""
    places: dict[str, tuple[float, float]] = {}
    for emotion in sorted(emotions.values(), key=lambda emotion: -emotion.arousal):
        x, y = _x(emotion.valence), _y(emotion.arousal)
        while any(abs(x - left) < ROOM[0] and abs(y - top) < ROOM[1] for left, top in places.values()):
            y += 1.0
        places[emotion.name] = x, y
    return places


def _x(valence: float) -> float:
    return 50 * (1 + valence / SPAN)


def _y(arousal: float) -> float:
    return 50 * (1 - arousal / SPAN)
