"""Recordings in a form of your own become files that can be read: my_recordings/ with a map and labels.

Then gesture-bot build-database my_recordings --map my_map.yaml --labels my_labels.csv -o mine.safetensors.
"""

from pathlib import Path

import numpy as np
import soundfile
import yaml

from gesture_bot.speech.voice import load_voice

RATE = 30  # frames a second
ARM = {"shoulder": (0.0, 0.18, 1.42), "elbow": (0.0, 0.25, 1.14), "wrist": (0.23, 0.2, 1.1)}
RIGHT = (1, -1, 1)


def read():
    """Put your own reader here: (n, 3) positions of each joint, in any unit, and 16 kHz of sound."""
    text = "My arms go up and down while I talk, and that is all that they can do. It will not win a prize."
    samples = load_voice("embedded").speak(text).samples
    times = np.arange(0.0, len(samples) / 16_000, 1 / RATE)
    swing = np.outer(0.15 * np.sin(2 * np.pi * 0.7 * times), (0.3, 0.0, 1.0))
    still = np.zeros_like(swing)
    joints = {"neck": still + (0.0, 0.0, 1.45)}
    for name, place in ARM.items():
        joints[f"L_{name}"] = np.add(place, swing if name == "wrist" else still)
        joints[f"R_{name}"] = np.add(place, -swing if name == "wrist" else still) * RIGHT
    return joints, samples


# Which joint is which keypoint, and where the axes point. A recording has the neck and both arms at least.
MAP = {
    "description": "arms that go up and down",
    "rate": RATE,
    "axes": ["forward", "left", "up"],
    "joints": {"neck": "neck"}
    | {f"left_{name}": f"L_{name}" for name in ARM}
    | {f"right_{name}": f"R_{name}" for name in ARM},
}

folder = Path("my_recordings")
folder.mkdir(exist_ok=True)
joints, samples = read()
header = ",".join(f"{joint}_{axis}" for joint in joints for axis in "xyz")
table = np.concatenate(list(joints.values()), axis=1)  # NaN where tracking is lost
np.savetxt(folder / "talk.csv", table, "%.4f", ",", header=header, comments="")
soundfile.write(folder / "talk.wav", samples, 16_000)  # beside the motion, with its name
Path("my_map.yaml").write_text(yaml.safe_dump(MAP, sort_keys=False))
Path("my_labels.csv").write_text("file,emotion,speaker\ntalk.csv,happy,me\n")
print(f"{folder}/talk.csv: {len(table)} frames of {len(joints)} joints")
