"""The strip below the robot: sound, words, beats, windows and control on one time axis, as it passes."""

from collections import deque
from dataclasses import dataclass
from html import escape
from itertools import zip_longest

import numpy as np

from gesture_bot.speech.cuts import Cuts

PAST, AHEAD = 8.0, 2.0
"""What is shown [s]: text is announced up to two seconds before it is heard."""

COLUMNS = 25
"""Columns of the waveform a second."""

LOUD = 0.25
"""Amplitude that fills the row."""

ROWS = {"sound": (0, 44), "words": (46, 45), "windows": (93, 24), "emotion": (117, 24), "control": (141, 24)}
"""Top and height of each row [pixels]."""

HEIGHT = 181

LINES = 3
"""Of words, which take turns, so that they do not cover each other."""

COLORS = {
    "speech": "#9dc3e6",
    "rest": "#e1e5ea",
    "bank": "#f4b860",
    "emotion": "#b5dcc3",
    "control": "#f3d9b1",
}
"""As in the picture of a run; see evaluate/timeline.py."""


@dataclass
class _Bar:
    """Something that lasts, until the next of its row begins where `end` is None [s since the epoch]."""

    start: float
    end: float | None
    label: str
    color: str


class Strip:
    """Keeps what the last seconds brought, and draws it."""

    def __init__(self) -> None:
        self._sound: dict[int, float] = {}
        self._words: deque[tuple[float, float, str, int]] = deque(maxlen=200)
        self._line = 0
        self._keywords: deque[tuple[float, float]] = deque(maxlen=50)
        self._beats: deque[float] = deque(maxlen=200)
        self._bars: dict[str, deque[_Bar]] = {
            row: deque(maxlen=60) for row in ("windows", "emotion", "control")
        }
        self._cuts = Cuts()

    def add_sound(self, source: str, utterance: int, start: float, samples: np.ndarray, rate: int) -> None:
        """Take in (n,) samples that are heard from a moment on [s since the epoch], `rate` a second."""
        if not len(samples) or rate <= 0 or self._cuts.void(source, utterance, start):
            return
        columns = np.floor((start + np.arange(len(samples)) / rate) * COLUMNS).astype(int)
        firsts = np.flatnonzero(np.diff(columns, prepend=columns[0] - 1))
        for column, peak in zip(columns[firsts], np.maximum.reduceat(np.abs(samples), firsts), strict=True):
            self._sound[column] = max(self._sound.get(column, 0.0), float(peak))

    def add_word(self, source: str, utterance: int, start: float, duration: float, text: str) -> None:
        """Take in a word."""
        if not self._cuts.void(source, utterance, start):
            self._line = (self._line + 1) % LINES
            self._words.append((start, start + duration, text, self._line))

    def add_keyword(self, start: float, duration: float) -> None:
        """Take in a keyword; its words are drawn bold."""
        self._keywords.append((start, start + duration))

    def add_beat(self, moment: float) -> None:
        """Take in a beat of the speech."""
        self._beats.append(moment)

    def add_window(self, start: float, end: float, source: str, name: str) -> None:
        """Take in a window; it replaces all from its start on."""
        bars = self._bars["windows"]
        while bars and bars[-1].start >= start - 1e-3:
            bars.pop()
        bars.append(_Bar(start, end, name or source, COLORS.get(source, "#cdbce8")))

    def set_state(self, since: float, emotion: str, controls: str) -> None:
        """What steers the choice from a moment on."""
        for row, label in (("emotion", emotion), ("control", controls)):
            bars = self._bars[row]
            if not bars or bars[-1].label != label:
                bars.append(_Bar(since, None, label, COLORS[row]))

    def cut(self, source: str, utterance: int, moment: float) -> None:
        """From a moment on, what was announced is not heard."""
        self._cuts.add(source, utterance, moment)
        self._sound = {column: peak for column, peak in self._sound.items() if column < moment * COLUMNS}
        self._words = deque((word for word in self._words if word[0] < moment), maxlen=self._words.maxlen)
        self._beats = deque((beat for beat in self._beats if beat < moment), maxlen=self._beats.maxlen)

    def html(self, now: float) -> str:
        """The strip as it is at a moment; it moves on by itself until it is drawn anew."""
        begin = now - PAST
        self._sound = {column: peak for column, peak in self._sound.items() if column >= begin * COLUMNS}
        parts = [self._waveform(begin)]
        parts += [
            f'<line x1="{x:.2f}%" x2="{x:.2f}%" y1="2" y2="42" class="beat"/>'
            for beat in self._beats
            if 0 <= (x := _percent(beat, begin)) <= 100
        ]
        parts += self._word_parts(begin)
        for row, bars in self._bars.items():
            parts += _bar_parts(row, list(bars), begin)
        labels = "".join(
            f'<text x="6" y="{top + height / 2 + 4}" class="row">{row}</text>'
            for row, (top, height) in ROWS.items()
        )
        seconds = "".join(
            f'<text x="{_percent(PAST + s, 0.0):.1f}%" y="{HEIGHT - 3}" class="axis">{s:+d} s</text>'
            for s in range(-int(PAST) + 1, int(AHEAD))
            if s
        )
        x = 100 * PAST / (PAST + AHEAD)
        return (
            f'<div class="studio-strip"><svg width="100%" height="{HEIGHT}">'
            f'<svg x="64" width="calc(100% - 64px)" height="{HEIGHT}" style="overflow:hidden">'
            f'<g class="moving">{"".join(parts)}</g>{seconds}'
            f'<line x1="{x}%" x2="{x}%" y1="0" y2="{HEIGHT - 14}" class="now"/>'
            f'<text x="{x}%" y="{HEIGHT - 3}" class="axis">now</text></svg>{labels}</svg></div>'
        )

    def _waveform(self, begin: float) -> str:
        """A shape in a box of its own, which is stretched to the width."""
        top, height = ROWS["sound"]
        first, count = int(begin * COLUMNS), int((PAST + AHEAD) * COLUMNS) + 2
        peaks = [min(1.0, self._sound.get(first + i, 0.0) / LOUD) for i in range(count)]
        middle, half = top + height / 2, height / 2 - 2
        xs = [4.0 * (i + first - begin * COLUMNS) for i in range(count)]
        upper = [f"{x:.0f},{middle - half * peak - 0.5:.1f}" for x, peak in zip(xs, peaks, strict=True)]
        lower = [f"{x:.0f},{middle + half * peak + 0.5:.1f}" for x, peak in zip(xs, peaks, strict=True)]
        points = " ".join(upper + lower[::-1])
        width = 4.0 * COLUMNS * (PAST + AHEAD)
        return (
            f'<svg viewBox="0 0 {width:.0f} {height}" preserveAspectRatio="none" '
            f'width="100%" height="{height}"><polygon points="{points}" class="wave"/></svg>'
        )

    def _word_parts(self, begin: float) -> list[str]:
        """Each word has room until the next one of its line begins."""
        top, height = ROWS["words"]
        parts, ends = [], [begin + 1.1 * (PAST + AHEAD)] * LINES  # beyond the edge, as the strip glides on
        for start, end, text, line in sorted(self._words, reverse=True):
            left, right = _percent(start, begin), _percent(ends[line], begin)
            ends[line] = start
            if left > -20 and right > max(left, 0.0):
                key = any(start < last and first < end for first, last in self._keywords)
                parts.append(
                    f'<svg x="{left:.2f}%" y="{top + line * height // LINES}" height="{height // LINES}" '
                    f'width="calc({right - left:.2f}% - 3px)" style="overflow:hidden">'
                    f'<text y="11" class="word{" key" * key}">{escape(text)}</text></svg>'
                )
        return parts


def _bar_parts(row: str, bars: list[_Bar], begin: float) -> list[str]:
    top, height = ROWS[row]
    parts = []
    for bar, following in zip_longest(bars, bars[1:]):
        end = bar.end if bar.end is not None else begin + PAST + AHEAD
        if following is not None:
            end = min(end, following.start)
        left, right = max(0.0, _percent(bar.start, begin)), min(110.0, _percent(end, begin))
        if left >= right or right < 0 or not bar.label:
            continue
        label = f'<text x="5" y="{height / 2 + 3}" class="bar">{escape(bar.label)}</text>'
        parts.append(
            f'<svg x="{left:.2f}%" y="{top}" width="{right - left:.2f}%" height="{height - 2}" '
            f'style="overflow:hidden"><rect width="100%" height="100%" rx="2" fill="{bar.color}"/>'
            f"{label}</svg>"
        )
    return parts


def _percent(moment: float, begin: float) -> float:
    return 100 * (moment - begin) / (PAST + AHEAD)


STYLE = """
.studio-strip { font-size: 12px; padding: 4px 6px 0; }
.studio-strip .row, .studio-strip .axis { fill: #8a94a0; font-size: 11px; }
.studio-strip .axis { text-anchor: middle; }
.studio-strip .wave { fill: #8a94a0; }
.studio-strip .word { fill: #26303a; }
.studio-strip .key { fill: #b34700; font-weight: bold; }
.studio-strip .bar { fill: #26303a; font-size: 11px; }
.studio-strip .beat { stroke: #b34700; stroke-width: 1.5; opacity: 0.6; }
.studio-strip .now { stroke: #e03131; stroke-width: 1.5; }
@media (prefers-reduced-motion: no-preference) {
.studio-strip .moving { animation: studio-strip 10s linear; transform-box: view-box; }
}
@keyframes studio-strip { to { transform: translateX(-100%); } }
"""
"""The whole strip passes in PAST + AHEAD seconds."""
