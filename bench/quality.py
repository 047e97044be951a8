"""MM22's table 3 in numbers, for the demo corpus or for recordings.

`make bench-quality`, or `python bench/quality.py DATABASE FILE...` with a database and recordings that it
does not hold. The last line is one JSON object: an entry a system, with the value and the 95% interval of
each metric, and those of the difference to smoothing alone. What could not be measured is null.
"""

import json
import math
import sys
from pathlib import Path

from machine import machine

from gesture_bot.corpus.demo import load_database
from gesture_bot.evaluate.performances import held_performances, recorded_performances
from gesture_bot.evaluate.quality import quality_table
from gesture_bot.evaluate.quality_files import markdown, quality_lines


def main() -> None:
    name, *files = sys.argv[1:] or ["demo"]
    database = load_database(name)
    performances = recorded_performances([*map(Path, files)], database) if files else held_performances()
    quality = quality_table(database, performances)
    print(markdown(quality))
    systems: dict[str, dict[str, object]] = {row.system: {"smoothed": row.smoothed} for row in quality.rows}
    for line in quality_lines(quality):
        figures = ("value", "low", "high", "difference", "difference_low", "difference_high")
        systems[str(line["system"])][str(line["metric"])] = {key: _figure(line[key]) for key in figures}
    facts = {"database": name, "minutes": round(quality.minutes, 2), "pieces": quality.pieces}
    print(json.dumps({"bench": "quality", **facts, "systems": systems, "machine": machine()}))


def _figure(value: object) -> float | None:
    return None if math.isnan(number := float(str(value))) else round(number, 5)


if __name__ == "__main__":
    main()
