"""A gesture as a picture: stick figures from the front and from the side, and the paths of the wrists."""

from pathlib import Path

import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gesture_bot.base.files import write_whole
from gesture_bot.base.keypoints import BONES, INDEX

_LEFT, _RIGHT, _TRUNK = "#1f6fb2", "#d1495b", "#3c4650"
_COLORS = [_TRUNK] * 7 + [_LEFT] * 5 + [_RIGHT] * 5
"""Of the bone that ends in each of KEYPOINTS."""

_VIEWS = (("front", 1), ("side", 0))
"""Each view's name, and the axis that it shows sideways: y, so that the left hand is on the right, or x."""

_FRAME = {"xlim": (-0.72, 0.72), "ylim": (-0.22, 1.12), "aspect": "equal", "xticks": (), "yticks": ()}
"""What is seen in each view [m]."""


def write_gesture_strip(
    path: Path, title: str, times: np.ndarray, keypoints: np.ndarray, moments: np.ndarray
) -> None:
    """Draw poses of a gesture side by side, each with the paths of the wrists over the whole of it.

    Args:
        path: File to write, ending in .png.
        title: Written above.
        times: (n,) moments of the frames, from the stroke [s].
        keypoints: (n, 17, 3) the frames [m], pelvis frame.
        moments: (m,) moments of the poses to draw [s].
    """
    figure = Figure(figsize=(0.6 + 2.1 * len(moments), 4.4), dpi=80, layout="constrained")
    figure.suptitle(title)
    panels = figure.subplots(len(_VIEWS), len(moments), squeeze=False)
    for column, moment in zip(panels.T, moments, strict=True):
        for axes, view in zip(column, _VIEWS, strict=True):
            _draw(axes, view, keypoints, int(np.abs(times - moment).argmin()))
        column[0].set_title("stroke" if moment == 0 else f"{moment:+.2f} s", fontsize=10)
    with write_whole(path) as temporary:
        figure.savefig(temporary)


def write_gesture_gif(path: Path, title: str, times: np.ndarray, keypoints: np.ndarray) -> None:
    """Draw a gesture as a film in real time, from the front and from the side.

    Args:
        path: File to write, ending in .gif.
        title: Written above.
        times: (n,) evenly spaced moments of the frames, from the stroke [s].
        keypoints: (n, 17, 3) the frames [m], pelvis frame.
    """
    figure = Figure(figsize=(6.4, 3.4), dpi=80)
    panels = figure.subplots(1, len(_VIEWS))

    def show(frame: int) -> list[Axes]:
        figure.suptitle(f"{title}   {times[frame]:+.2f} s")
        for axes, view in zip(panels, _VIEWS, strict=True):
            axes.clear()
            _draw(axes, view, keypoints, frame)
        return list(panels)

    film = FuncAnimation(figure, show, frames=len(times), interval=1000 * (times[1] - times[0]))
    with write_whole(path) as temporary:
        film.save(temporary, PillowWriter(fps=round(1 / (times[1] - times[0]))))


def _draw(axes: Axes, view: tuple[str, int], keypoints: np.ndarray, frame: int) -> None:
    """One stick figure, and the paths of its wrists over all frames."""
    name, across = view
    for parent, child in BONES:
        bone = keypoints[frame, [parent, child]]
        color = _COLORS[child]
        axes.plot(bone[:, across], bone[:, 2], color=color, linewidth=3, solid_capstyle="round")
    head = keypoints[frame, [INDEX["head"], INDEX["head_top"]]].mean(axis=0)
    axes.plot(head[across], head[2], "o", color=_TRUNK, markersize=11)
    for side, color in (("left", _LEFT), ("right", _RIGHT)):
        wrist = keypoints[:, INDEX[f"{side}_wrist"]]
        axes.plot(wrist[:, across], wrist[:, 2], color=color, linewidth=1, alpha=0.4)
    axes.set(**_FRAME)
    axes.set_ylabel(name, fontsize=9)
