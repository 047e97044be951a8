"""Sound in packets that are lost, late, doubled, or of another rate."""

import numpy as np
import pytest
import soxr

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.base.frames import FRAME_RATE, first_frame_after
from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.features import COEFFICIENTS, STATIC, speech_features
from gesture_bot.speech.streaming import Packet, SpeechStream
from gesture_bot.speech.voice import load_voice

BEGIN = 1_795_655_000.0  # on the frame grid
PIECE = 512


@pytest.fixture(scope="module")
def speech():
    return (
        load_voice("embedded").speak("Hello everybody, and welcome. Take a picture of the big boat.").samples
    )


def packets(samples, begin=BEGIN, rate=SAMPLE_RATE, piece=PIECE):
    firsts = range(0, len(samples), piece)
    return [
        Packet(1, begin + i / rate, rate, samples[i : i + piece], i + piece >= len(samples)) for i in firsts
    ]


def pushed(stream, sent):
    frames = [frame for packet in sent for frame in stream.push(packet)]
    return [frame.index for frame in frames], np.array([frame.features for frame in frames])


def test_packets_give_the_features_of_the_whole(speech):
    numbers, features = pushed(SpeechStream(), packets(speech))
    assert numbers[0] == first_frame_after(BEGIN)
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
    np.testing.assert_allclose(features, speech_features(speech), rtol=1e-5, atol=1e-5)


def test_sound_may_begin_between_two_frames(speech):
    late = 0.02
    numbers, features = pushed(SpeechStream(), packets(speech, BEGIN + late))
    skipped = round((1 / FRAME_RATE - late) * SAMPLE_RATE)
    assert numbers[0] == first_frame_after(BEGIN) + 1
    np.testing.assert_allclose(features, speech_features(speech[skipped:]), rtol=1e-5, atol=1e-5)


def test_lost_packets_become_silence_and_doubled_ones_nothing(speech):
    sent = packets(speech)
    stream = SpeechStream()
    broken = [*sent[:20], *sent[23:40], sent[38], sent[39], *sent[40:]]
    numbers, features = pushed(stream, broken)
    whole = speech.copy()
    whole[20 * PIECE : 23 * PIECE] = 0
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
    np.testing.assert_allclose(features, speech_features(whole), rtol=1e-5, atol=1e-5)
    assert stream.lost == pytest.approx(3 * PIECE / SAMPLE_RATE)
    assert stream.late == pytest.approx(2 * PIECE / SAMPLE_RATE)
    told = stream.troubles(BEGIN)
    assert ["lost" in told[0], "late" in told[1]] == [True, True]
    assert stream.troubles(BEGIN) == []


def test_the_rate_may_change_in_the_middle(speech):
    half = len(speech) // 2 // 10 * 10
    second = soxr.resample(speech[half:], SAMPLE_RATE, 48_000)
    sent = packets(speech[:half])[:-1]
    rest = speech[len(sent) * PIECE : half]
    moment = BEGIN + len(sent) * PIECE / SAMPLE_RATE
    sent += [Packet(1, moment, SAMPLE_RATE, rest, False)]
    sent += packets(second, BEGIN + half / SAMPLE_RATE, 48_000, 1536)
    stream = SpeechStream()
    numbers, features = pushed(stream, sent)
    expected = speech_features(speech)
    assert abs(len(numbers) - len(expected)) <= 1
    change = half * FRAME_RATE // SAMPLE_RATE
    apart = np.abs(features[: len(expected), :COEFFICIENTS] - expected[: len(features), :COEFFICIENTS])
    assert np.median(apart[change + 2 :]) < 1.0
    assert "16000 to 48000" in " ".join(stream.troubles(BEGIN + 10))


def test_clipping_and_a_dead_source_are_told(speech):
    stream = SpeechStream()
    sent = packets(np.clip(20 * speech, -1, 1))[:40]
    pushed(stream, sent)
    assert any("clipped" in trouble for trouble in stream.troubles(stream.until))
    assert stream.troubles(stream.until + 0.5) == []
    assert "nothing was heard for 3 s" in stream.troubles(stream.until + 3.0)
    # It comes back: the frames go on where the sound does.
    back = [Packet(1, sent[-1].moment + 60.0, SAMPLE_RATE, packet.samples, False) for packet in sent[:3]]
    numbers, _ = pushed(stream, back[:1] + packets(speech, back[0].moment + PIECE / SAMPLE_RATE))
    assert numbers[0] == first_frame_after(back[0].moment)
    assert stream.troubles(stream.until or back[0].moment) == []


def test_sound_that_is_long_over_is_dropped_and_counted(speech):
    stream, sent = SpeechStream(), packets(speech)
    frames = [frame for packet in sent[:40] for frame in stream.push(packet, packet.moment + 0.1)]
    assert len(frames) > 15
    for packet in sent[40:45]:
        assert stream.push(packet, packet.moment + 5.0) == []
    assert stream.late == pytest.approx(5 * PIECE / SAMPLE_RATE)
    frames = [frame for packet in sent[45:] for frame in stream.push(packet, packet.moment + 0.1)]
    assert stream.lost == pytest.approx(5 * PIECE / SAMPLE_RATE)
    assert len(frames) > 10


@pytest.mark.parametrize("bad", [{"rate": 0}, {"samples": np.array([0.1, np.nan], np.float32)}])
def test_a_bad_packet_changes_nothing(speech, bad):
    sent, stream = packets(speech), SpeechStream()
    frames = []
    for number, packet in enumerate(sent):
        if number == 10:
            fields = {"rate": packet.rate, "samples": packet.samples, **bad}
            with pytest.raises(InvalidValueError):
                stream.push(Packet(1, packet.moment, fields["rate"], fields["samples"], False))
        frames += stream.push(packet)
    np.testing.assert_allclose(
        np.array([frame.features for frame in frames])[:, :STATIC],
        speech_features(speech)[:, :STATIC],
        rtol=1e-5,
        atol=1e-5,
    )
