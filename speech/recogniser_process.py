"""The recogniser in a process of its own, which makes way for the servo bus."""

import logging
import os
import socket
import subprocess
import sys
from collections import deque
from collections.abc import Iterable
from contextlib import suppress
from multiprocessing.connection import Connection

import numpy as np

from gesture_bot.base.errors import GestureBotError
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.recogniser import PIECE, RecognisedWord

ON_THE_WAY = 10
"""Pieces that it holds at most; the others wait here."""

LONGEST_QUEUE = 50
"""Pieces that wait at most. When more come, the oldest are dropped."""

Key = tuple[str, int]
"""Source and number of an utterance."""

_Piece = tuple[Key, float, np.ndarray | None]


class RecogniserProcess:
    """Sound in, words out a little later, without waiting for either.

    The process ends with this one, however that ends: it reads from a socket until the other end is gone.

    Args:
        phrases: See Recogniser.
    """

    def __init__(self, phrases: Iterable[str]) -> None:
        ours, theirs = socket.socketpair()
        with theirs:
            # Not multiprocessing's own start: that would import the program that runs here once more.
            self._process = subprocess.Popen(
                [sys.executable, "-m", __name__, str(theirs.fileno())],
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                start_new_session=True,  # Ctrl-C is for this one, with which it ends
            )
        self._connection = Connection(ours.detach())
        self._waiting: deque[_Piece] = deque()
        self._on_the_way = 0
        self._dropped = 0
        self.problems: list[str] = []
        self.set_phrases(phrases)

    @property
    def dropped(self) -> float:
        """How much sound was dropped, since it came faster than it could be decoded [s]."""
        return self._dropped * PIECE / SAMPLE_RATE

    def set_phrases(self, phrases: Iterable[str]) -> None:
        """Listen for other phrases from now on."""
        self._send(list(phrases))

    def push(self, key: Key, moment: float, samples: np.ndarray, last: bool = False) -> None:
        """Take in sound.

        Args:
            key: Of the utterance that it belongs to; comes back with its words.
            moment: Of the first sample [s].
            samples: (n,) float32, mono, at SAMPLE_RATE.
            last: Whether the utterance ends with it.
        """
        for first in range(0, len(samples), PIECE):
            self._waiting.append((key, moment + first / SAMPLE_RATE, samples[first : first + PIECE]))
        if last:
            self._waiting.append((key, moment + len(samples) / SAMPLE_RATE, None))
        self._pass_on()
        while len(self._waiting) > LONGEST_QUEUE:
            self._waiting.popleft()
            self._dropped += 1

    def words(self) -> list[tuple[Key, RecognisedWord]]:
        """What has been recognised since the last call. Call it often: it also passes waiting sound on.

        Raises:
            GestureBotError: The process has ended.
        """
        words = []
        try:
            while self._connection.poll():
                found, problems = self._connection.recv()
                words += found
                if problems is None:
                    self._on_the_way -= 1
                else:
                    self.problems = problems
        except (EOFError, OSError) as error:
            raise self._ended() from error
        self._pass_on()
        return words

    def close(self) -> None:
        """End the process."""
        self._connection.close()
        self._process.wait()

    def _pass_on(self) -> None:
        while self._waiting and self._on_the_way < ON_THE_WAY:
            self._send(self._waiting.popleft())
            self._on_the_way += 1

    def _send(self, message: object) -> None:
        try:
            self._connection.send(message)
        except OSError as error:
            raise self._ended() from error

    def _ended(self) -> GestureBotError:
        return GestureBotError(
            "the process that recognises words has ended, exit status", self._process.wait()
        )


def _serve(connection: Connection) -> None:
    """Answer until the other end is closed: phrases by what is wrong with them, each piece by its words."""
    from gesture_bot.speech.recogniser import Recogniser

    # Half a word at the end of a transcript may not fit its sound.
    logging.getLogger("gesture_bot.speech.alignment").setLevel(logging.ERROR)
    recogniser: Recogniser | None = None
    key: Key = ("", 0)
    while True:
        message = connection.recv()
        words = []
        if recogniser and (isinstance(message, list) or message[0] != key):
            words = [(key, word) for word in recogniser.flush()]
        if isinstance(message, list):
            recogniser = Recogniser(message)
            connection.send((words, recogniser.problems))
        elif recogniser:
            key, moment, samples = message
            more = connection.poll()
            found = recogniser.flush() if samples is None else recogniser.push(samples, moment, more)
            connection.send((words + [(key, word) for word in found], None))


if __name__ == "__main__":
    os.nice(10)  # the servo bus goes first
    with suppress(EOFError, OSError):
        _serve(Connection(int(sys.argv[1])))
