"""A sound card's buffer: each sample at its moment, whatever the card's clock does."""

import numpy as np
import pytest

from gesture_bot.speech.playback import DRIFT, Playback

RATE, BLOCK = 16_000, 512
BEGIN = 1_795_655_000.0


def played(playback, seconds, begin=BEGIN, drift=0.0, jitter=0.0, at=lambda _moment: None):
    """What a card with a clock of its own plays; `at` is called before each block."""
    generator = np.random.default_rng(0)
    blocks, moment = [], begin
    while moment < begin + seconds:
        at(moment)
        blocks.append(playback.read(moment + jitter * generator.standard_normal(), BLOCK))
        moment += BLOCK / RATE * (1 + drift)
    return np.concatenate(blocks)


def tone(seconds):
    return np.sin(2 * np.pi * 440 * np.arange(round(seconds * RATE)) / RATE).astype(np.float32)


@pytest.mark.parametrize("piece", [160, 1600, 7001])
def test_pieces_are_heard_at_their_moment_without_a_seam(piece):
    playback, sound = Playback(RATE), tone(2.0)
    for first in range(0, len(sound), piece):
        playback.put(BEGIN + 0.5 + first / RATE, sound[first : first + piece])
    heard = played(playback, 3.0, jitter=0.002)
    onset = np.flatnonzero(heard)[0]
    assert abs(onset / RATE - 0.5) < 0.01
    assert np.array_equal(heard[onset - 1 : onset - 1 + len(sound)], sound)
    assert not heard[onset + len(sound) :].any()


def test_a_card_whose_clock_is_wrong_stays_with_the_time():
    playback = Playback(RATE)
    for second in range(300):
        click = np.zeros(RATE, np.float32)
        click[0] = 1.0
        playback.put(BEGIN + second, click)
    heard = played(playback, 300.0, drift=3e-4)  # it would be 90 ms late at the end
    clicks = np.flatnonzero(heard == 1.0) / RATE * (1 + 3e-4)
    # Where the clock is set right, a click may be left out or come twice.
    assert 290 <= len(clicks) <= 310
    assert np.abs((clicks + 0.5) % 1 - 0.5).max() < DRIFT + 0.001


def test_a_cut_silences_what_was_put_in_and_nothing_else():
    playback = Playback(RATE)
    playback.put(BEGIN + 0.1, tone(2.0))
    playback.put(BEGIN + 2.1, tone(1.0), utterance=2)

    def at(moment):
        if abs(moment - BEGIN - 0.5) < BLOCK / RATE / 2:
            playback.put(BEGIN + 1.0, np.full(RATE, 0.5, np.float32), utterance=3)
            playback.cut(moment, utterance=2)

    heard = played(playback, 3.0, at=at)
    assert np.abs(heard[round(0.2 * RATE) : round(0.45 * RATE)]).max() > 0.9
    assert not heard[round(0.55 * RATE) : round(0.99 * RATE)].any()
    assert np.array_equal(heard[round(1.05 * RATE) : round(1.95 * RATE)], np.full(round(0.9 * RATE), 0.5))
    assert not heard[round(2.05 * RATE) :].any()
