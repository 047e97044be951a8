"""A picture of a gesture of the semantic banks."""

import argparse
from pathlib import Path

import numpy as np

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.frames import FRAME_RATE
from gesture_bot.corpus.body import Posture, pose
from gesture_bot.corpus.gestures import rest_state
from gesture_bot.corpus.styles import STYLES
from gesture_bot.evaluate.gesture_picture import write_gesture_gif, write_gesture_strip
from gesture_bot.matching.banks import load_banks, read_bank
from gesture_bot.matching.rendering import render


def command(options: argparse.Namespace) -> int:
    """Draw one gesture as it grows out of rest and goes back to it.

    Raises:
        InvalidValueError: No such gesture, or the picture is to be neither .png nor .gif.
        FileFormatError: See banks.read_bank.
    """
    gestures = read_bank(options.bank) if options.bank else load_banks()
    if options.gesture not in gestures:
        raise InvalidValueError("unknown gesture", options.gesture, sorted(gestures))
    output = options.output or Path(f"{options.gesture}.png")
    if output.suffix not in (".png", ".gif"):
        raise InvalidValueError("a picture of a gesture cannot be", output.suffix, [".png", ".gif"])

    gesture = gestures[options.gesture]
    movement = gesture.movement
    begin, end = movement.first - gesture.preparation, movement.last + gesture.retraction
    times = np.arange(begin, end, 1 / FRAME_RATE)
    keypoints = render(gesture, times, gesture.preparation, np.repeat(_at_rest(), len(times), axis=0))
    if output.suffix == ".gif":
        write_gesture_gif(output, options.gesture, times, keypoints)
    else:
        write_gesture_strip(output, options.gesture, times, keypoints, movement.moments)
    print(f"wrote {output}")
    return 0


def _at_rest() -> np.ndarray:
    """(1, 17, 3) somebody who stands still [m]."""
    hand, still = rest_state(STYLES["neutral"])[None], np.zeros((1, 3))
    return pose(Posture(hand, hand, still, still, 0.2))
