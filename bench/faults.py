"""What the robot makes of faults: the real driver on a virtual bus, in simulated time.

`make bench-faults`; the last line is one JSON object, an entry a fault, and two where the robot's file
decides what the other joints do.
"""

import json

from rich.console import Console
from rich.table import Table

from gesture_bot.evaluate.faults import FAULTS, try_fault
from gesture_bot.retarget.robot import load_robot


def main() -> None:
    robot = load_robot("toa")
    table = Table("fault", "told of after [s]", "back after [s]", "fastest / limit", "failures")
    result: dict[str, object] = {}
    for name, fault in FAULTS.items():
        for on_fault in ("stop", "carry_on") if fault.stops else ("stop",):
            outcome = try_fault(robot, name, on_fault)
            label = f"{name}, others {on_fault.replace('_', ' ')}" if fault.stops else name
            table.add_row(
                label,
                f"{outcome.seconds:.2f}",
                f"{outcome.back:.2f}",
                f"{outcome.fastest:.2f}",
                "; ".join(outcome.failures),
            )
            result[label] = {
                "survived": not outcome.failures,
                "seconds": round(outcome.seconds, 3),
                "back_seconds": round(outcome.back, 3),
                "speed_share": round(outcome.fastest, 3),
            }
    Console().print(table)
    print(json.dumps(result))


if __name__ == "__main__":
    main()
