"""The demo corpus: built from a few sentences here, by the same code that builds the whole."""

import numpy as np
import pytest

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.corpus import demo
from gesture_bot.corpus.database import SEQUENCE, Database
from gesture_bot.corpus.demo import database_path, demo_corpus, demo_database, load_database
from gesture_bot.corpus.sentences import SENTENCES
from gesture_bot.corpus.styles import STYLES
from gesture_bot.speech.features import FEATURES, SILENCE_FEATURES, STATIC

FEW = {
    "sad": ["We waited a long time, but in the end nobody came.", "It is hard to say goodbye."],
    "excited": ["Look how high the kite is flying!", "There were hundreds of balloons, all rising at once!"],
}


@pytest.fixture(scope="module")
def built() -> Database:
    return demo_corpus(FEW, workers=2)


def test_speech_and_silence_of_every_emotion_are_in_it(built):
    assert built.names["emotion"] == ("sad", "excited")
    assert built.features.shape == (len(built.keypoints), FEATURES)
    loudness, silence = built.features[:, STATIC - 1], SILENCE_FEATURES[STATIC - 1]
    for emotion in built.names["emotion"]:
        loud = [
            loudness[start : start + SEQUENCE].max()
            for start in built.starts[built.labelled("emotion", emotion)]
        ]
        assert max(loud) > silence + 30
        assert min(loud) == silence


def test_the_result_does_not_depend_on_the_number_of_workers(built):
    alone = demo_corpus(FEW, workers=1)
    for name in ("keypoints", "features", "starts", "labels", "recording"):
        assert getattr(alone, name).tobytes() == getattr(built, name).tobytes()


def test_another_seed_moves_otherwise(built):
    other = demo_corpus(FEW, seed=1)
    assert not np.array_equal(other.keypoints[:SEQUENCE], built.keypoints[:SEQUENCE])


def test_it_is_built_once_and_kept(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(demo, "SENTENCES", {"bored": FEW["sad"][:1]})
    path = demo_database()
    assert path.is_relative_to(tmp_path)
    assert Database.load(path).names["emotion"] == ("bored",)
    more = load_database("shuffled:5")
    assert more.names["emotion"] == ("bored",)
    assert len(more.keypoints) > 1.5 * len(Database.load(path).keypoints)
    monkeypatch.setattr(demo, "demo_corpus", None)
    assert database_path("demo") == path
    assert load_database("shuffled:5") is more


def test_shuffled_sentences_have_their_words_in_another_order(monkeypatch):
    said = []
    monkeypatch.setattr(demo, "_record", lambda voice, take: said.extend(take.sentences))
    list(demo.demo_performances({"sad": FEW["sad"]}, "", rounds=3, workers=1, shuffled=True))
    assert len(set(said)) > 4
    assert not set(said) & set(FEW["sad"])
    assert {tuple(sorted(one.split())) for one in said} == {tuple(sorted(one.split())) for one in FEW["sad"]}


@pytest.mark.parametrize("rounds", ["", "0", "many"])
def test_rounds_that_are_no_number_are_refused(rounds):
    with pytest.raises(InvalidValueError, match=f"rounds in shuffled:N: '{rounds}'; valid: 1 and more"):
        load_database(f"shuffled:{rounds}")


def test_an_interrupted_build_leaves_nothing(monkeypatch, tmp_path):
    def interrupted(voice, take):
        raise KeyboardInterrupt

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(demo, "_record", interrupted)
    with pytest.raises(KeyboardInterrupt):
        demo_database()
    assert not list((tmp_path / "gesture_bot").iterdir())


def test_sentences_are_of_emotions_that_have_a_style():
    assert list(SENTENCES) == list(STYLES)
    assert all(4 <= len(sentence.split()) <= 22 for said in SENTENCES.values() for sentence in said)
