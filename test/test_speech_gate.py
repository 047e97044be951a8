"""The robot's own voice and its servos do not pass its microphone; people do."""

import numpy as np
import pytest

from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.gate import AFTER_MOTION, ECHO, MicrophoneGate
from gesture_bot.speech.voice import load_voice

BEGIN = 1_795_655_000.0
BLOCK = 512


@pytest.fixture(scope="module")
def voice():
    said = (
        load_voice("embedded").speak("Good morning, could you please tell me where the station is?").samples
    )
    return said / np.sqrt(np.mean(said**2))


def arm_speed(seconds, seed):
    """A gesturing arm's speed at each sample [rad/s]."""
    t = np.arange(round(seconds * SAMPLE_RATE)) / SAMPLE_RATE
    return 1.1 + np.sin(2 * np.pi * 0.8 * t + seed) * np.sin(2 * np.pi * 0.31 * t)


def servo_noise(speed, seed):
    """Gear whine whose pitch and loudness follow the speed, and uneven brush noise; RMS about 1."""
    generator = np.random.default_rng(seed)
    phase = 2 * np.pi * np.cumsum(150 + 225 * speed) / SAMPLE_RATE
    whine = sum(np.sin(k * phase) / k for k in (1, 2, 3, 5, 7))
    uneven = np.repeat(generator.uniform(0.7, 1.4, len(speed) // 800 + 1), 800)[: len(speed)]
    noise = speed**0.7 * (whine + 0.7 * uneven * generator.standard_normal(len(speed)))
    return noise / np.sqrt(np.mean(noise**2))


def through(gate, samples, speed=None):
    blocks = []
    for first in range(0, len(samples), BLOCK):
        moment = BEGIN + first / SAMPLE_RATE
        if speed is not None:
            gate.moves(moment, moment + 0.3, speed[first])
        blocks.append(gate.passed(moment, SAMPLE_RATE, samples[first : first + BLOCK]))
    return np.concatenate(blocks)


def test_nothing_passes_while_the_robot_speaks_and_all_before_and_after(voice):
    gate = MicrophoneGate()
    for piece in range(10):  # 1 s, as it is published ahead of its sound
        gate.speaks(BEGIN + 1 + piece / 10, BEGIN + 1.1 + piece / 10)
    heard = through(gate, voice)
    open_again = round((2 + ECHO) * SAMPLE_RATE)
    assert np.array_equal(heard[: SAMPLE_RATE - BLOCK], voice[: SAMPLE_RATE - BLOCK])
    assert not heard[SAMPLE_RATE:open_again].any()
    assert np.array_equal(heard[open_again + BLOCK :], voice[open_again + BLOCK :])


def test_a_sentence_that_is_cut_short_opens_the_gate(voice):
    gate = MicrophoneGate()
    gate.speaks(BEGIN, BEGIN + 60)
    gate.silent_from(BEGIN + 1)
    heard = through(gate, voice)
    after = round((1 + ECHO) * SAMPLE_RATE) + BLOCK
    assert not heard[:SAMPLE_RATE].any()
    assert np.array_equal(heard[after:], voice[after:])


@pytest.mark.parametrize("seed", range(3))
def test_servos_do_not_pass_and_a_voice_over_them_does(voice, seed):
    """Arms that move for 12 s, and somebody who speaks after 5 s, 20 dB louder than they are."""
    speed = arm_speed(12.0, seed)
    noise = 0.005 * servo_noise(speed, seed)
    mixed = noise.copy()
    said = slice(5 * SAMPLE_RATE, 5 * SAMPLE_RATE + len(voice))
    mixed[said] += 0.05 * voice
    heard = through(MicrophoneGate(), mixed, speed)
    passed = np.abs(heard) > 0
    assert passed[: 5 * SAMPLE_RATE - BLOCK].mean() < 0.02
    assert passed[said.stop + SAMPLE_RATE // 2 :].mean() < 0.02
    assert np.sum(heard[said] ** 2) > 0.97 * np.sum(mixed[said] ** 2)


def test_at_rest_soft_speech_passes(voice):
    gate = MicrophoneGate()
    gate.moves(BEGIN - 5, BEGIN - AFTER_MOTION, 2.0)
    assert np.array_equal(through(gate, 1e-3 * voice), 1e-3 * voice)
