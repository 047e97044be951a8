"""Sound and text in: 15 Hz speech features, spoken words with their times, keywords."""

import gesture_bot.base  # noqa: F401  before onnxruntime, which it keeps silent
