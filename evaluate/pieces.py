"""Pieces of speech with two motions: the speaker's own, and the one that is judged."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.frames import FRAME_RATE

PIECE = 5.0
"""Where there are few performances, they are cut into pieces of about this length [s]."""

MANY = 10
"""From so many performances on, each is one piece: parts of one recording are like each other."""

FEWEST = 4
"""With fewer pieces nothing can be said of their spread."""


@dataclass(frozen=True, eq=False)
class Performance:
    """Something said, and the speaker's own motion to it.

    Attributes:
        name: What errors call it.
        features: (n, 28) speech features; see speech/features.py.
        speech: (n,) bool: whether somebody speaks in a frame.
        recorded: (n, 17, 3) keypoints [m], pelvis frame.
        beats: (b,) rising beats of the speech [s from its beginning]; None where its sound is not there.
    """

    name: str
    features: np.ndarray
    speech: np.ndarray
    recorded: np.ndarray
    beats: np.ndarray | None


@dataclass(frozen=True)
class Motion:
    """What a system shows to a performance.

    Attributes:
        keypoints: (n, 17, 3) a frame to each of the performance [m].
        seams: (s,) frames before which one chosen window ends and the next begins.
    """

    keypoints: np.ndarray
    seams: np.ndarray = field(default_factory=lambda: np.zeros(0, int))


@dataclass(frozen=True)
class Piece:
    """A piece of a performance and of what is shown to it.

    Attributes:
        shown: (n, 17, 3) the motion that is judged [m].
        recorded: (n, 17, 3) the speaker's own [m].
        seams: (s,) frames of the piece before which a window of `shown` begins.
        beats: (b,) beats of the whole performance [s from the piece's beginning]; None where not known.
    """

    shown: np.ndarray
    recorded: np.ndarray
    seams: np.ndarray
    beats: np.ndarray | None


def pieces_of(performances: Sequence[Performance], motions: Sequence[Motion]) -> list[Piece]:
    """Performances and what is shown to them, cut alike.

    Raises:
        InvalidValueError: There are fewer than FEWEST pieces.
    """
    pieces = []
    for performance, motion in zip(performances, motions, strict=True):
        frames = len(performance.recorded)
        count = 1 if len(performances) >= MANY else max(1, round(frames / FRAME_RATE / PIECE))
        cuts = np.linspace(0, frames, count + 1).round().astype(int)
        for begin, end in zip(cuts[:-1], cuts[1:], strict=True):
            inside = motion.seams[(motion.seams > begin) & (motion.seams < end)]
            pieces.append(
                Piece(
                    motion.keypoints[begin:end],
                    performance.recorded[begin:end],
                    inside - begin,
                    None if performance.beats is None else performance.beats - begin / FRAME_RATE,
                )
            )
    if len(pieces) < FEWEST:
        least = f"{FEWEST * PIECE:.0f} s and more"
        raise InvalidValueError("too little recorded motion to judge by: pieces", len(pieces), [least])
    return pieces


def mismatched(pieces: Sequence[Piece]) -> list[Piece]:
    """Each piece with the recorded motion of another one, as long as the shorter of both.

    The other one is of the same half; see frechet.py.
    """
    out = list(pieces)
    for half in (slice(0, None, 2), slice(1, None, 2)):
        own = list(pieces[half])
        turned = own[len(own) // 2 :] + own[: len(own) // 2]
        out[half] = [_with_motion(piece, other.recorded) for piece, other in zip(own, turned, strict=True)]
    return out


def _with_motion(piece: Piece, motion: np.ndarray) -> Piece:
    frames = min(len(piece.recorded), len(motion))
    return replace(piece, shown=motion[:frames], recorded=piece.recorded[:frames], seams=np.zeros(0, int))
