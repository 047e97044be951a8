"""What the page tells in words and numbers: who is in control, what steers, and how the servos are."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape

STYLE = """
.studio-facts { padding: 4px 10px 8px; font-size: 13px; color: #26303a; }
.studio-facts .big { font-size: 15px; font-weight: 600; margin: 6px 0 2px; }
.studio-facts .dim { color: #6b7580; font-size: 12px; }
.studio-facts .bad { color: #c92a2a; font-weight: 600; }
.studio-facts .trouble { color: #c92a2a; font-size: 12px; margin-top: 6px; }
.studio-facts table { width: 100%; border-collapse: collapse; margin-top: 6px; font-size: 12px; }
.studio-facts th { text-align: right; font-weight: 500; color: #6b7580; padding: 2px 3px; }
.studio-facts td { text-align: right; padding: 2px 3px; border-top: 1px solid #eef1f4; white-space: nowrap; }
.studio-facts th:first-child, .studio-facts td:first-child { text-align: left; white-space: normal; }
.studio-facts .owner { display: inline-block; border-radius: 3px; padding: 0 5px; background: #e1e5ea; }
.studio-facts .gesture { background: #d3ecee; } .studio-facts .teleop { background: #fbe3b5; }
.studio-facts .stop { background: #ffc9c9; }
"""


@dataclass
class Servo:
    """A servo: temperature [degC] and load [share of the stall torque]; what is wrong with it, in words."""

    temperature: float = math.nan
    load: float = math.nan
    trouble: str = ""


@dataclass
class Facts:
    """What is known of the graph.

    Attributes:
        owners: Who moves each joint.
        servos: By joint.
        look_ahead: How much later than live sound its motion is seen [s]; NaN before that is heard.
        lag: How far the joints are behind their plan [s].
        live: Whether what is heard now is live, so that its motion comes a look-ahead later.
        troubles: What nodes complain of, in words, by node.
    """

    owners: Mapping[str, str] = field(default_factory=dict)
    servos: dict[str, Servo] = field(default_factory=dict)
    look_ahead: float = math.nan
    lag: float = math.nan
    live: bool = False
    troubles: dict[str, str] = field(default_factory=dict)

    def html(self, joints: Sequence[str]) -> str:
        """All of it as HTML; what came from elsewhere is escaped."""
        parts = self._control(), self._delay(), self._table(joints), self._troubles()
        return f'<div class="studio-facts">{"".join(parts)}</div>'

    def _control(self) -> str:
        names = sorted(set(self.owners.values()))
        counts = [f"{_owner(name)} {list(self.owners.values()).count(name)} joints" for name in names]
        return f'<div class="big">In control</div>{", ".join(counts) or "nobody is heard"}'

    def _delay(self) -> str:
        delay = self.lag + self.look_ahead * self.live
        told = "unknown" if math.isnan(delay) else f"{1000 * delay:.0f} ms"
        how = "sound heard live" if self.live else "speech known ahead"
        live = 1000 * (self.lag + self.look_ahead)
        other = "" if self.live or math.isnan(live) else f"; {live:.0f} ms for live sound"
        return f'<div class="big">Sound to motion: {told}</div><div class="dim">{how}{other}</div>'

    def _troubles(self) -> str:
        told = [f"{part}: {trouble}" for part, trouble in self.troubles.items()]
        return "".join(f'<div class="trouble">{escape(line)}</div>' for line in told)

    def _table(self, joints: Sequence[str]) -> str:
        rows = []
        for joint in joints:
            servo = self.servos.get(joint, Servo())
            mark = ' class="bad"' if servo.trouble else ""
            rows.append(
                f'<tr><td{mark} title="{escape(servo.trouble)}">{escape(joint.replace("_", " "))}</td>'
                f"<td>{_owner(self.owners.get(joint, ''))}</td>"
                f"<td>{_number(servo.temperature, '°C')}</td><td>{_number(100 * servo.load, '%')}</td></tr>"
            )
        return f"<table><tr><th>joint</th><th>by</th><th>temp.</th><th>load</th></tr>{''.join(rows)}</table>"


def _owner(name: str) -> str:
    return f'<span class="owner {escape(name)}">{escape(name)}</span>' if name else ""


def _number(value: float, unit: str) -> str:
    return "–" if math.isnan(value) else f"{value:.0f} {unit}"
