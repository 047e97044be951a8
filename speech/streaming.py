"""Sound in packets, as it comes over a network or from a microphone: joined, repaired, made into features."""

from collections import deque
from dataclasses import dataclass

import numpy as np
import soxr

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.frames import first_frame_after, frame_time
from gesture_bot.speech.activity import ActivityStream
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.beats import BeatStream, Intervals
from gesture_bot.speech.features import FeatureStream
from gesture_bot.speech.loudness import LoudnessNormaliser

JITTER = 0.03
"""The stamps of packets that follow each other are so exact [s]."""

LONGEST_GAP = 1.0
"""A longer gap is not filled: what comes after it begins anew [s]."""

FULL_SCALE = 0.999
"""Samples from here on are clipped."""

CLIPPING = 0.002
"""More than so much of it between two reports is worth a word [s]."""

STALE = 1.1
"""Sound that ended so long ago moves nobody any more: the longest look-ahead [s]."""

_PIECE = 60 * SAMPLE_RATE

DEAD, GONE = 1.5, 60.0
"""A source that has not ended and sends nothing for so long has trouble, and has ended without a word [s]."""


@dataclass(frozen=True)
class Packet:
    """A piece of one speech signal.

    Attributes:
        utterance: Counts up with every new signal of a source.
        moment: When the first sample is heard [s since the epoch].
        rate: Samples a second.
        samples: (n,) float32, one channel, full scale 1.
        last: Whether the utterance ends with it.
    """

    utterance: int
    moment: float
    rate: int
    samples: np.ndarray
    last: bool


@dataclass(frozen=True)
class SpeechFrame:
    """What is heard in a frame.

    Attributes:
        index: On the frame grid.
        features: (28,); see features.py.
        speech: Whether somebody speaks; see activity.py.
        beats: Beats of the speech that are known since the frame before, most of which lie before this one
            [s from its beginning]; see beats.py.
    """

    index: int
    features: np.ndarray
    speech: bool
    beats: tuple[float, ...] = ()


def speech_frames(samples: np.ndarray, intervals: Intervals | None = None) -> list[SpeechFrame]:
    """What is heard in a whole recording, (n,) samples at audio.SAMPLE_RATE, from frame 0 on.

    Raises:
        InvalidValueError: The samples are not all finite numbers.
    """
    stream, frames = SpeechStream(intervals), []
    # The windows of a whole hour at once would be gigabytes.
    for begin in range(0, len(samples), _PIECE):
        piece, last = samples[begin : begin + _PIECE], begin + _PIECE >= len(samples)
        frames += stream.push(Packet(1, begin / SAMPLE_RATE, SAMPLE_RATE, piece, last))
    return frames


class SpeechStream:
    """The sound of one source, whatever happens to its packets, as features on the frame grid.

    Lost packets are replaced by silence, late and doubled ones dropped; a change of the sample rate goes
    unheard.

    Args:
        intervals: From beat to beat; see beats.py.

    Attributes:
        lost: Silence filled in for packets that did not come [s].
        late: Sound that came after its place was filled, dropped [s].
        clipped: Samples at full scale [s].
        rate: Of the last packet [Hz].
        until: End of what has come [s since the epoch]; None between utterances.
    """

    def __init__(self, intervals: Intervals | None = None) -> None:
        self._intervals = intervals
        self.lost = self.late = self.clipped = 0.0
        self.rate = 0
        self.until: float | None = None
        self._utterance = 0
        # One for the features, and one for the beats: each takes in the sound for itself.
        self._loudness = LoudnessNormaliser(), LoudnessNormaliser()
        self._activity = ActivityStream()
        self._spoken: deque[bool] = deque()
        self._told = (0.0, 0.0, 0.0)
        self._changed = ""

    def push(self, packet: Packet, now: float = -np.inf) -> list[SpeechFrame]:
        """Take in the next packet.

        Args:
            packet: The packet.
            now: The present [s since the epoch]; a packet that comes STALE seconds too late is dropped.

        Returns:
            The frames that it completes.

        Raises:
            InvalidValueError: It has no sample rate, or samples that are not finite. The stream is as before.
        """
        if packet.rate <= 0:
            raise InvalidValueError("sound needs a sample rate; got", packet.rate, ["1 Hz and more"])
        if not np.isfinite(packet.samples).all():
            raise InvalidValueError("sound has samples that are not finite numbers")
        length = len(packet.samples) / packet.rate
        if packet.moment + length < now - STALE:
            self.late += length
            if packet.last and packet.utterance == self._utterance:
                self.until = None
            return []
        gap = packet.moment - self.until if self.until is not None else np.inf
        if packet.utterance != self._utterance or abs(gap) > LONGEST_GAP:
            self._begin(packet)
            gap = 0.0
        assert self.until is not None
        frames = self._changed_rate(packet.rate)
        samples = packet.samples
        self.clipped += np.count_nonzero(np.abs(samples) >= FULL_SCALE) / packet.rate
        if gap > JITTER:
            filled = round(gap * packet.rate)
            self.lost += filled / packet.rate
            samples = np.concatenate([np.zeros(filled, np.float32), samples])
        elif gap < -JITTER:
            dropped = min(round(-gap * packet.rate), len(samples))
            self.late += dropped / packet.rate
            samples = samples[dropped:]
        self.until += len(samples) / packet.rate
        frames += self._frames(self._resampler.resample_chunk(samples, last=packet.last))
        if packet.last:
            frames += self._heard(self._features.flush(), self._activity.flush(), self._beats.flush())
            self.until = None
        return frames

    def end(self, utterance: int) -> None:
        """The rest of the utterances up to one will not come."""
        if utterance >= self._utterance:
            self.until = None

    def troubles(self, now: float) -> list[str]:
        """What went wrong since this was asked last, in words; empty when all is well.

        Args:
            now: The present [s since the epoch].
        """
        lost, late, clipped = self._told
        self._told = self.lost, self.late, self.clipped
        found = [self._changed] if self._changed else []
        self._changed = ""
        if self.lost > lost:
            found.append(f"{self.lost - lost:.2f} s of sound were lost")
        if self.late > late:
            found.append(f"{self.late - late:.2f} s of sound came too late")
        if self.clipped > clipped + CLIPPING:
            found.append("the sound is clipped: turn it down")
        silent = now - self.until if self.until is not None else 0.0
        if silent > DEAD:
            found.append(f"nothing was heard for {silent:.0f} s")
        if silent > GONE:
            self.until = None
        return found

    def _begin(self, packet: Packet) -> None:
        self._utterance, self.until, self.rate = packet.utterance, packet.moment, packet.rate
        self._frame = first_frame_after(packet.moment)
        # Sound from a microphone begins anywhere: what lies before the first whole frame is left out.
        self._skip = max(0, round((frame_time(self._frame) - packet.moment) * SAMPLE_RATE))
        self._resampler = soxr.ResampleStream(packet.rate, SAMPLE_RATE, 1, dtype="float32")
        self._features = FeatureStream(self._loudness[0])
        self._beats = BeatStream(self._intervals, self._loudness[1])
        self._begun, self._known = self._frame, np.zeros(0)
        self._activity.flush()
        self._spoken.clear()

    def _changed_rate(self, rate: int) -> list[SpeechFrame]:
        """Frames completed by what a resampler still holds, where the next packet has another rate."""
        if rate == self.rate:
            return []
        rest = self._resampler.resample_chunk(np.zeros(0, np.float32), last=True)
        self._changed = f"the sample rate changed from {self.rate} to {rate} Hz"
        self.rate = rate
        self._resampler = soxr.ResampleStream(rate, SAMPLE_RATE, 1, dtype="float32")
        return self._frames(rest)

    def _frames(self, samples: np.ndarray) -> list[SpeechFrame]:
        skipped = min(self._skip, len(samples))
        self._skip -= skipped
        samples = samples[skipped:]
        return self._heard(
            self._features.push(samples), self._activity.push(samples), self._beats.push(samples)
        )

    def _heard(self, features: np.ndarray, activity: np.ndarray, beats: np.ndarray) -> list[SpeechFrame]:
        # Activity is known a little earlier than the features; most beats are known later.
        self._spoken.extend(activity)
        self._known = np.concatenate([self._known, beats])
        frames = []
        for vector in features:
            since = frame_time(self._frame - self._begun)
            known = tuple((self._known - since).tolist())
            frames.append(SpeechFrame(self._frame, vector, bool(self._spoken.popleft()), known))
            self._known = np.zeros(0)
            self._frame += 1
        return frames
