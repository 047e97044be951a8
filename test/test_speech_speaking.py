"""The queue of what is said: order, lead, cuts."""

import numpy as np
import pytest

from gesture_bot.base.frames import FRAME_RATE
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.cuts import Cuts
from gesture_bot.speech.speaking import Piece, Speaking, Spoken
from gesture_bot.speech.voice import Utterance

LEAD, DELAY = 2.0, 0.8
NOW = 1000.0


def utterance(seconds, mark=0.0):
    return Utterance(np.full(round(seconds * SAMPLE_RATE), mark, np.float32), ())


def heard(speaking, begin, end, step=0.05):
    """Everything that is given out between two moments, with the moment of each."""
    return [(now, one) for now in np.arange(begin, end, step) for one in speaking.due(now)]


def test_utterances_follow_each_other_and_come_ahead_of_their_sound():
    speaking = Speaking(LEAD, DELAY)
    first, second = (speaking.put(utterance(3.0, mark), NOW) for mark in (0.1, 0.2))
    assert NOW + DELAY <= first.start < NOW + DELAY + 1 / FRAME_RATE
    assert first.end <= second.start < first.end + 1 / FRAME_RATE
    given = heard(speaking, NOW, NOW + 10)
    assert [one for _, one in given if isinstance(one, Spoken)] == [first, second]
    pieces = [(now, one) for now, one in given if isinstance(one, Piece)]
    for now, piece in pieces:
        assert now >= piece.moment - LEAD
        assert now <= max(NOW, piece.moment - LEAD) + 0.3
    for number, spoken in ((1, first), (2, second)):
        own = [piece for _, piece in pieces if piece.number == number]
        assert np.array_equal(np.concatenate([piece.samples for piece in own]), spoken.utterance.samples)
        assert [piece.last for piece in own] == [False] * (len(own) - 1) + [True]
        assert own[0].moment == spoken.start
    assert speaking.end == second.end


def test_a_cut_while_it_is_heard_voids_the_rest_and_the_next_moves_up():
    speaking = Speaking(LEAD, DELAY)
    first, second = speaking.put(utterance(5.0), NOW), speaking.put(utterance(1.0), NOW)
    heard(speaking, NOW, NOW + 3)
    assert speaking.cut([first], NOW + 3) == (NOW + 3, 2)
    assert NOW + 3 + DELAY <= second.start < NOW + 3 + DELAY + 1 / FRAME_RATE
    given = heard(speaking, NOW + 3, NOW + 8)
    assert given[0][1] is second
    assert {one.number for _, one in given[1:]} == {3}
    assert sum(len(one.samples) for _, one in given[1:]) == SAMPLE_RATE


def test_what_waits_is_taken_back_without_a_gap_for_the_one_before():
    speaking = Speaking(LEAD, DELAY)
    first, second, third = (speaking.put(utterance(4.0), NOW) for _ in range(3))
    heard(speaking, NOW, NOW + 1)
    assert speaking.cut([second], NOW + 1) is None, "nothing of it has been given out"
    given = [one for _, one in heard(speaking, NOW + 1, NOW + 12)]
    assert [one for one in given if isinstance(one, Spoken)] == [third]
    assert third.start == pytest.approx(first.end, abs=1 / FRAME_RATE)
    assert {one.number for one in given if isinstance(one, Piece)} == {1, 4}
    assert [one.last for one in given if isinstance(one, Piece) and one.number == 1][-1]


def test_all_of_it_is_cut():
    speaking = Speaking(LEAD, DELAY)
    everything = [speaking.put(utterance(4.0), NOW) for _ in range(3)]
    heard(speaking, NOW, NOW + 2)
    assert speaking.cut(everything, NOW + 2) == (NOW + 2, 3)
    assert heard(speaking, NOW + 2, NOW + 20) == []
    urgent = speaking.put(utterance(1.0), NOW + 2)
    assert urgent.start <= NOW + 2 + DELAY + 1 / FRAME_RATE


def test_what_has_been_heard_is_not_taken_back():
    speaking = Speaking(LEAD, DELAY)
    said = speaking.put(utterance(1.0), NOW)
    heard(speaking, NOW, NOW + 5)
    assert speaking.cut([said], NOW + 5) is None
    assert speaking.cut([], NOW + 5) is None


def test_what_comes_next_is_taken_back_once_it_is_given_out():
    speaking = Speaking(LEAD, DELAY)
    first, second = (speaking.put(utterance(4.0), NOW) for _ in range(2))
    heard(speaking, NOW, NOW + 3.5)
    assert speaking.cut([second], NOW + 3.5) == (second.start, 2)
    given = [one for _, one in heard(speaking, NOW + 3.5, NOW + 10)]
    assert {one.number for one in given} <= {1}
    assert speaking.end == pytest.approx(first.end, abs=1 / FRAME_RATE)


def test_only_what_the_cut_concerns_is_void():
    cuts = Cuts()
    cuts.add("voice", 3, 10.0)
    assert cuts.void("voice", 3, 10.0)
    assert cuts.void("voice", 1, 11.0)
    assert not cuts.void("voice", 3, 9.9), "it has been heard"
    assert not cuts.void("voice", 4, 11.0), "it was announced later"
    assert not cuts.void("microphone", 1, 11.0)
