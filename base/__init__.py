"""What every room shares: errors, the frame grid, keypoints, vectors, joint trajectories, settings files."""

import os

# Where it is imported, onnxruntime 1.32 tells its maker what it runs on, under a number of this computer.
os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")
