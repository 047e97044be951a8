"""How long each stage of the graph takes, from what a recorder heard."""

import bisect

import numpy as np

from gesture_bot.base.frames import FRAME_RATE
from gesture_bot.matching.selector import AHEAD
from gesture_bot.nodes.recorder import Heard, Record

LAST_WINDOW = 0.0175
"""A frame is complete so long after its end at most: its last 25 ms window lies half outside [s]."""


def stage_latencies(record: Record) -> dict[str, dict[str, float]]:
    """Median and 99th percentile of each stage's latency [ms].

    The time from the arrival of what a stage needs to the arrival of what it makes: `features` from the sound
    that completes a frame, `selection` from the moment a window is due, `refinement` from the chosen window,
    `retargeting` from the refined one, and `bus`, which holds the mux and a bus cycle, from the joint
    trajectory to the next measured joint state.
    """
    samples = {
        "features": _features(record),
        "selection": _selection(record),
        "refinement": _following(record.selected, record.refined),
        "retargeting": _following(record.refined, record.trajectories),
        "bus": _following(record.trajectories, record.joint_states),
    }
    return {
        stage: {
            "median": round(float(np.median(values)) * 1e3, 3),
            "p99": round(float(np.percentile(values, 99)) * 1e3, 3),
            "count": len(values),
        }
        for stage, values in samples.items()
        if values
    }


def _features(record: Record) -> list[float]:
    """From the piece of sound that completes a frame to the frame's features."""
    ends = [heard.stamp + len(heard.message.samples) / heard.message.sample_rate for heard in record.audio]
    latencies = []
    for heard in record.features:
        piece = bisect.bisect_left(ends, heard.stamp + 1 / FRAME_RATE + LAST_WINDOW)
        if piece < len(ends):
            latencies.append(heard.arrival - record.audio[piece].arrival)
    return latencies


def _selection(record: Record) -> list[float]:
    """From the moment a window is due, `AHEAD` before it is seen; 0 where it came earlier."""
    return [
        max(0.0, heard.arrival - (heard.stamp - AHEAD))
        for heard in record.selected
        if heard.message.source == "speech"
    ]


def _following(causes: list[Heard], effects: list[Heard]) -> list[float]:
    """From each cause to the first effect that arrives after it."""
    arrivals = [heard.arrival for heard in effects]
    latencies = []
    for cause in causes:
        effect = bisect.bisect_left(arrivals, cause.arrival)
        if effect < len(arrivals):
            latencies.append(arrivals[effect] - cause.arrival)
    return latencies
