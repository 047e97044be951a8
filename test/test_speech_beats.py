"""Beats of speech: those of librosa's onsets, for any chunk size, with the intervals that RG22 asks for."""

from itertools import cycle
from pathlib import Path

import numpy as np
import pytest

from gesture_bot.base.errors import FileFormatError, InvalidValueError
from gesture_bot.speech import onsets
from gesture_bot.speech.audio import SAMPLE_RATE, load_audio
from gesture_bot.speech.beats import NOISE_LEVEL, BeatStream, Intervals, load_intervals, speech_beats
from gesture_bot.speech.features import FLOOR, MELS
from gesture_bot.speech.loudness import LoudnessNormaliser
from gesture_bot.speech.voice import load_voice

RECORDINGS = Path(__file__).parents[2] / "shared" / "data" / "gestures_from_speech"

TEXT = (
    "The new tram line runs from the harbour to the hospital every seven minutes. "
    "My sister plants potatoes between the roses, and both of them seem to like it."
)


@pytest.fixture(scope="module")
def speech():
    pause = np.zeros(3 * SAMPLE_RATE, np.float32)
    samples = load_voice("embedded").speak(TEXT).samples
    return np.concatenate([pause, samples, pause, samples])


@pytest.fixture(scope="module", params=["embedded voice", "1845", "3838"])
def sound(request, speech):
    if request.param == "embedded voice":
        return speech
    path = RECORDINGS / f"{request.param}.wav"
    if not path.exists():
        pytest.skip(f"no real recording at {path}")
    return load_audio(path)


def librosa_beats(samples, shortest, longest):
    """Beats of the whole signal, in windows: librosa's onsets, the dense ones dropped, the gaps filled."""
    import librosa

    padded = np.concatenate([samples, np.zeros(SAMPLE_RATE)])
    signal = LoudnessNormaliser().push(padded)
    settings = {"n_fft": 400, "hop_length": 160, "center": False}
    power = librosa.feature.melspectrogram(y=signal, sr=SAMPLE_RATE, n_mels=MELS, **settings)
    decibels = librosa.power_to_db(power, amin=10 ** (FLOOR / 10), top_db=None)
    strength = librosa.onset.onset_strength(S=decibels, center=False)
    found = librosa.onset.onset_detect(
        onset_envelope=strength,
        normalize=False,
        pre_max=onsets.BEFORE,
        post_max=onsets.AFTER + 1,
        pre_avg=onsets.AVERAGED,
        post_avg=onsets.AVERAGED + 1,
        wait=onsets.WAIT,
        delta=onsets.THRESHOLD,
        units="frames",
    )
    energy = librosa.util.frame(signal, frame_length=400, hop_length=160)
    spoken = np.flatnonzero(10 * np.log10(np.mean(energy**2, axis=0) + 1e-20) > NOISE_LEVEL)
    beats = [found[0]]
    while len(later := found[found >= beats[-1] + shortest]):
        last, onset = beats[-1], later[0]
        sounding = spoken[(spoken >= last + shortest) & (spoken <= onset - shortest)]
        end = sounding[0] if len(sounding) else onset
        if onset - last <= longest:
            beats.append(onset)
        elif end - last <= longest:
            beats.append(end)
        else:
            beats.append(last + longest if end - last > 2 * longest else (last + end) // 2)
    return (160 * np.array(beats) + 200) / SAMPLE_RATE


@pytest.mark.parametrize("intervals", [Intervals(), Intervals(0.3, 0.6)])
def test_beats_are_those_of_librosas_onsets(sound, intervals):
    beats = speech_beats(sound, intervals)
    expected = librosa_beats(sound, round(100 * intervals.shortest), round(100 * intervals.longest))
    assert len(beats) > 2 * len(sound) / SAMPLE_RATE / 2
    # After the last onset nothing is known of the gap that follows.
    np.testing.assert_allclose(beats[: len(expected)], expected, atol=1e-9)
    gaps = np.diff(beats)
    assert gaps.min() > intervals.shortest - 1e-9
    assert gaps.max() < intervals.longest + 1e-9


@pytest.mark.parametrize("sizes", [[1], [7, 0], [1067, 1066], [4001], [70_000]])
def test_stream_equals_offline(sound, sizes):
    samples = sound if sizes[0] > 100 else sound[: 2 * SAMPLE_RATE]
    stream, beats, position = BeatStream(), [], 0
    for size in cycle(sizes):
        beats.append(stream.push(samples[position : position + size]))
        position += size
        if position >= len(samples):
            break
    np.testing.assert_array_equal(np.concatenate([*beats, stream.flush()]), speech_beats(samples))


def test_beats_are_known_soon(sound):
    """An onset within 0.13 s, a pseudo-beat at most the longest interval later."""
    stream, late = BeatStream(), []
    for number, block in enumerate(np.array_split(sound, len(sound) // 160), 1):
        late += (number * 0.01 - stream.push(block)).tolist()
    assert np.median(late) < 0.15
    assert max(late) < 0.13 + 0.5 + 0.01


def clicks(*moments, seconds=6.0):
    """Short bursts of noise in silence."""
    samples = np.zeros(round(seconds * SAMPLE_RATE))
    noise = 0.2 * np.random.default_rng(3).standard_normal(800)
    for moment in moments:
        begin = round(moment * SAMPLE_RATE)
        samples[begin : begin + 800] = noise
    return samples


def test_beats_of_clicks():
    beats = speech_beats(clicks(1.0, 1.35, 1.45, 1.8, 2.7, 5.0))
    # The third is too near; the first gap is halved; the second has the longest interval as long as it goes.
    expected = [1.0, 1.35, 1.8, 2.25, 2.7, 3.2, 3.7, 4.2, 4.6, 5.0]
    np.testing.assert_allclose(beats[: len(expected)], expected, atol=0.02)


def test_a_held_vowel_has_beats():
    """No onset comes, but it sounds on: beats at the shortest interval."""
    time = np.arange(SAMPLE_RATE) / SAMPLE_RATE
    vowel = 0.1 * np.sign(np.sin(2 * np.pi * 150 * time))
    beats = speech_beats(np.concatenate([clicks(0.3, seconds=1.0), vowel, clicks(0.5, seconds=1.0)]))
    held = beats[(beats > 1.1) & (beats < 1.9)]
    np.testing.assert_allclose(np.diff(held), 0.2, atol=0.011)


def test_silence_and_nothing_have_no_beats():
    assert len(speech_beats(np.zeros(5 * SAMPLE_RATE))) == len(speech_beats(np.zeros(0))) == 0


def test_bad_samples_are_refused_and_leave_the_stream_as_it_was(speech):
    stream = BeatStream()
    beats = stream.push(speech[:70_000])
    with pytest.raises(InvalidValueError, match="finite"):
        stream.push(np.array([0.1, np.nan]))
    beats = np.concatenate([beats, stream.push(speech[70_000:]), stream.flush()])
    np.testing.assert_array_equal(beats, speech_beats(speech))


def test_intervals_of_a_language(tmp_path):
    assert load_intervals("en") == load_intervals("xx") == Intervals(0.2, 0.5)
    assert load_intervals("zh-TW") == load_intervals("zh") == Intervals(0.3, 0.6)
    mine = tmp_path / "beats.yaml"
    mine.write_text("fi: [0.25, 0.5]\nsv: [0.3, 0.5]\n")
    with pytest.raises(FileFormatError, match=r"line 2: sv: the longest .* at least twice"):
        load_intervals("fi", mine)
