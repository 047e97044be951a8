"""Gestures of your own beside ours: writes my_banks/, for gesture-bot run banks:=my_banks."""

import shutil
from pathlib import Path

import yaml

from gesture_bot.base.files import config_dir
from gesture_bot.matching.banks import load_banks

SALUTE = {
    "triggers": ["captain", "at your service", {"sir": 0.5}],  # a light word gives way to a rarer one near it
    "preparation": 0.6,  # from rest to the first keyframe [s]
    "mirrored": True,  # by the hand that is nearer
    "keyframes": [
        # The stroke, at time 0, falls on the stressed vowel of the first word.
        {"time": 0.0, "hold": 0.6, "right": "at_the_brow", "head": {"nod": -4}},
        {"time": 1.0, "right": "home"},  # a pose of poses.yaml
    ],
}
# Where the wrist is from its shoulder, in lengths of the stretched arm: so it fits any robot.
AT_THE_BROW = {
    "wrist": {"forward": 0.28, "out": 0.1, "up": 0.4},
    "palm": "down forward",
    "fingers": "up in",
    "elbow": "out",
}

folder = Path("my_banks")
shutil.copytree(config_dir() / "banks", folder, dirs_exist_ok=True)  # without this, only yours are made
bank = {"poses": {"at_the_brow": AT_THE_BROW}, "gestures": {"salute": SALUTE}}
(folder / "mine.yaml").write_text(yaml.safe_dump(bank, sort_keys=False))
print(f"{len(load_banks(folder))} gestures in {folder}")  # a mistake is named with file, line and key
