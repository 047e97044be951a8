"""A selector against a clock, for the tests of matching."""

import numpy as np
from small_database import small_database, sound

from gesture_bot.base.frames import FRAME_RATE, frame_time
from gesture_bot.base.keypoints import INDEX
from gesture_bot.matching.banks import load_banks
from gesture_bot.matching.emotions import load_emotions
from gesture_bot.matching.selector import Selector
from gesture_bot.matching.speaker import LEAST_SPEECH
from gesture_bot.speech.features import COEFFICIENTS

DATABASE = small_database()
GESTURES, EMOTIONS = load_banks(), load_emotions()
WRISTS = [INDEX["left_wrist"], INDEX["right_wrist"]]

START = 1_700_000_000 * FRAME_RATE
"""The frame at which every test begins."""

SPEECH = sound(np.random.default_rng(9), 300)[:200]
"""Features of 13 s of speech."""


def selector(**options):
    return Selector(DATABASE, GESTURES, EMOTIONS, **options)


class Show:
    """Runs a selector against a clock of 30 Hz, and keeps what would be seen."""

    def __init__(self, chooser):
        self.chooser = chooser
        self.now = frame_time(START)
        self.windows, self.seen = [], {}

    def run(self, seconds, speech=(), speech_start=None, lead=2.0):
        """Let time pass; speech frames come in `lead` seconds before they are heard."""
        end = self.now + seconds
        coming = dict(enumerate(speech, speech_start or 0))
        while self.now < end:
            for frame in [frame for frame in coming if frame_time(frame) - lead <= self.now]:
                self.hear(frame, coming.pop(frame))
            self.tick()
            self.now += 1 / 30
        return self

    def hear(self, frame, features, **options):
        self.chooser.hearing.add_features(frame, features, features[COEFFICIENTS] > LEAST_SPEECH, **options)

    def tick(self):
        windows = self.chooser.plan(self.now)
        for window in windows:
            assert window.start >= self.now * FRAME_RATE
            if self.seen:
                assert window.start <= max(self.seen) + 1
                assert window.start - 1 in self.seen
            self.seen = {frame: shown for frame, shown in self.seen.items() if frame < window.start}
            self.seen.update(enumerate(((pose, window) for pose in window.keypoints), window.start))
        self.windows += windows
        return windows

    @property
    def keypoints(self):
        """(n, 17, 3) what was seen."""
        return np.array([self.seen[frame][0] for frame in sorted(self.seen)])

    @property
    def sources(self):
        return [self.seen[frame][1].source for frame in sorted(self.seen)]

    def wrists(self, source):
        """(n, 2, 3) positions and (n, 2) speeds of the wrists at the frames from one source."""
        frames = [source == name for name in self.sources]
        wrists = self.keypoints[:, WRISTS]
        speeds = np.linalg.norm(np.gradient(wrists, 1 / FRAME_RATE, axis=0), axis=-1)
        return wrists[frames], speeds[frames]
