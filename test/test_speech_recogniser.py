"""Words in real speech: the embedded voice tells when it said them, the recogniser when it heard them."""

import os
import subprocess
import sys
import time

import numpy as np
import psutil
import pytest
from conftest import wait_until

from gesture_bot.base.errors import GestureBotError, InvalidValueError
from gesture_bot.matching.banks import load_banks, triggers
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.pronunciation import pronounce
from gesture_bot.speech.recogniser import Recogniser
from gesture_bot.speech.recogniser_process import LONGEST_QUEUE, ON_THE_WAY, PIECE, RecogniserProcess
from gesture_bot.speech.voice import load_voice

pytestmark = pytest.mark.live

TEXT = "Good morning, everybody. Please wait a minute, the old bridge is dangerous."
A, B = ("microphone", 1), ("microphone", 2)
QUEUED = (LONGEST_QUEUE - 1) * PIECE
KEYWORDS = ["good", "morning", "everybody", "please", "wait", "dangerous"]


@pytest.fixture(scope="module")
def said():
    return load_voice("embedded").speak(TEXT)


@pytest.fixture
def recogniser():
    return Recogniser(triggers(load_banks()))


def hear(recogniser, samples, size=PIECE, start=100.0):
    """Each word with the moment up to which sound had come, as (word, moment)."""
    heard = []
    for first in range(0, len(samples), size):
        piece = samples[first : first + size]
        words = recogniser.push(piece, start + first / SAMPLE_RATE)
        heard += [(word, start + (first + len(piece)) / SAMPLE_RATE) for word in words]
    end = start + len(samples) / SAMPLE_RATE
    return heard + [(word, end) for word in recogniser.flush()]


def test_words_are_heard_when_they_were_said_and_soon_after(recogniser, said):
    heard = hear(recogniser, said.samples)
    assert [word.text for word, _ in heard if word.text in KEYWORDS] == KEYWORDS
    spoken = {word.text.lower(): word for word in said.words}
    for word, moment in heard:
        if word.text in KEYWORDS:
            assert word.start - 100 == pytest.approx(spoken[word.text].start, abs=0.15)
            assert word.end - 100 == pytest.approx(spoken[word.text].end, abs=0.35)
            assert moment - word.end < 0.6
            assert 0.5 < word.confidence <= 1
    starts = [word.start for word, _ in heard]
    assert starts == sorted(starts)


@pytest.mark.parametrize("size", [113, 3 * SAMPLE_RATE])
def test_the_size_of_pieces_does_not_matter(recogniser, said, size):
    words = [word for word, _ in hear(recogniser, said.samples, size)]
    again = [word for word, _ in hear(Recogniser(triggers(load_banks())), said.samples)]
    assert [word.text for word in words] == [word.text for word in again]
    assert [word.start for word in words] == pytest.approx([word.start for word in again], abs=0.15)


def test_noise_alone_holds_no_words_and_some_noise_leaves_most(recogniser, said):
    noise = np.random.default_rng(0).standard_normal(len(said.samples)).astype(np.float32)
    level = np.sqrt(np.mean(said.samples**2)) * 10 ** (-10 / 20)
    assert not hear(recogniser, level * noise)
    heard = [word.text for word, _ in hear(recogniser, said.samples + level * noise, start=200.0)]
    assert len(set(KEYWORDS) & set(heard)) >= 4, heard


def test_a_gap_ends_what_came_before_and_later_sound_has_its_own_time(recogniser, said):
    first = next(word for word in said.words if word.text == "Please")
    cut = round((first.start - 0.1) * SAMPLE_RATE)
    words = recogniser.push(said.samples[:cut], 10.0)
    words += recogniser.push(said.samples[cut:], 50.0) + recogniser.flush()
    times = {word.text: word.start for word in words}
    assert times["everybody"] < 10.0 + first.start
    assert times["please"] == pytest.approx(50.1, abs=0.15)


def test_a_word_that_no_dictionary_has_is_said_as_it_is_spelt():
    recogniser = Recogniser(["blorptastic", "hello"])
    assert not recogniser.problems
    said = load_voice("embedded").speak("We bought a blorptastic red kite.")
    assert "blorptastic" in [word.text for word, _ in hear(recogniser, said.samples)]
    assert pronounce("robot") == "R OW B AA T"


def test_a_word_that_cannot_be_said_is_named_and_the_others_are_heard(said):
    recogniser = Recogniser(["…", "… day", "please"])
    (problem,) = recogniser.problems
    assert "'…'" in problem
    assert "please" in [word.text for word, _ in hear(recogniser, said.samples)]
    with pytest.raises(InvalidValueError, match="…"):
        pronounce("…")


@pytest.fixture
def process():
    process = RecogniserProcess(triggers(load_banks()))
    yield process
    process.close()


def collect(process, wanted, key):
    heard = []

    def complete():
        heard.extend(word.text for found, word in process.words() if found == key)
        return set(wanted) <= set(heard)

    wait_until(complete, 60, f"{wanted}")
    return heard


def test_a_process_hears_the_same_and_other_phrases_when_told(process, said):
    process.push(A, 100.0, said.samples[:QUEUED], last=True)
    collect(process, KEYWORDS[:-1], A)
    process.set_phrases(["the old bridge"])
    process.push(B, 200.0, said.samples[-30 * PIECE :], last=True)
    collect(process, ["the", "old", "bridge"], B)
    assert process.dropped == 0


def test_sound_that_comes_too_fast_is_dropped_from_the_oldest_on(process, said):
    long = np.concatenate([said.samples] * 4)
    process.push(A, 100.0, long)
    assert process.dropped > 0
    kept = (LONGEST_QUEUE + ON_THE_WAY) * PIECE
    assert process.dropped >= (len(long) - kept) / SAMPLE_RATE - 0.2
    process.push(A, 100.0 + len(long) / SAMPLE_RATE, said.samples[:PIECE], last=True)
    collect(process, ["dangerous"], A)


PARENT = """
import sys, time
from gesture_bot.speech.recogniser_process import RecogniserProcess
process = RecogniserProcess(["hello"])
print(process._process.pid, flush=True)
time.sleep(60)
"""


def test_the_process_ends_with_its_parent_also_when_that_is_killed():
    parent = subprocess.Popen([sys.executable, "-c", PARENT], stdout=subprocess.PIPE, text=True)
    child = psutil.Process(int(parent.stdout.readline()))
    assert child.is_running()
    parent.kill()
    parent.wait()
    parent.stdout.close()
    wait_until(lambda: not child.is_running() or child.status() == psutil.STATUS_ZOMBIE, 30, "its end")


def test_a_process_that_dies_is_told():
    process = RecogniserProcess(["hello"])
    os.kill(process._process.pid, 9)
    time.sleep(0.2)
    with pytest.raises(GestureBotError, match="has ended, exit status: -9"):
        wait_until(process.words, 10, "an error")
    process.close()
