"""The emotions that a robot can be told: the labels of hri_msgs/Expression (REP-155)."""

from typing import Literal, get_args

Label = Literal[
    "neutral", "angry", "sad", "happy", "surprised", "disgusted", "scared", "pleading", "vulnerable",
    "despaired", "guilty", "disappointed", "embarrassed", "horrified", "skeptical", "annoyed", "furious",
    "suspicious", "rejected", "bored", "tired", "asleep", "confused", "amazed", "excited",
]  # fmt: skip

LABELS: tuple[str, ...] = get_args(Label)
"""All of them."""
