"""Refinement: from chosen windows to one smooth motion."""

import gesture_bot.base  # noqa: F401  before onnxruntime, which it keeps silent
