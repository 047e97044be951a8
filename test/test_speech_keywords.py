import pytest

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.speech.keywords import KeywordSpotter, Spotted
from gesture_bot.speech.voice import Word, load_voice

TRIGGERS = {
    "good": "yes",
    "good morning": "hello",
    "Good morning, everybody!": "everybody",
    "don't": "no",
    "me": "me",
}


def words(text, start=0.0):
    """A second from word to word; a dash takes no time."""
    spoken, moment = [], start
    for word in text.split():
        spoken.append(Word(word, moment, moment + 0.75, moment + 0.25))
        moment += any(map(str.isalnum, word))
    return spoken


def gestures(spotted):
    return [one.gesture for one in spotted]


@pytest.fixture
def spotter():
    return KeywordSpotter(TRIGGERS)


def test_times_and_phrase(spotter):
    assert spotter.spot(words("well good morning to you")) == [
        Spotted(gesture="hello", phrase="good morning", start=1.0, end=2.75, stress=1.25)
    ]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("GOOD, morning... Everybody?", ["everybody"]),
        ("good evening", ["yes"]),
        ("good good morning good", ["yes", "hello", "yes"]),
        ("Don't!", ["no"]),
        ("Don\N{RIGHT SINGLE QUOTATION MARK}t tell (me)", ["no", "me"]),
        ("some men remember goodness", []),
        ("good — morning", ["hello"]),
        ("", []),
    ],
)
def test_longest_phrase_without_regard_to_case_and_punctuation(spotter, text, expected):
    assert gestures(spotter.spot(words(text)) + spotter.flush()) == expected


@pytest.mark.parametrize(
    "text", ["so good morning everybody", "good morning to me", "good for me good morning good"]
)
def test_split_across_calls_finds_the_same(spotter, text):
    whole = KeywordSpotter(TRIGGERS)
    one_by_one = [found for word in words(text) for found in spotter.spot([word])]
    assert one_by_one + spotter.flush() == whole.spot(words(text)) + whole.flush()


def test_only_a_phrase_that_may_go_on_waits(spotter):
    assert gestures(spotter.spot(words("me"))) == ["me"]
    assert spotter.spot(words("good")) == []
    assert gestures(spotter.flush()) == ["yes"]
    assert spotter.flush() == []


def test_no_triggers():
    assert KeywordSpotter({}).spot(words("hello there")) == []


@pytest.mark.parametrize("phrase", ["", " ", "?!"])
def test_trigger_without_a_word(phrase):
    with pytest.raises(InvalidValueError, match="holds no word"):
        KeywordSpotter({phrase: "hello"})


def test_in_spoken_text(spotter):
    spoken = load_voice("embedded").speak("Good morning, everybody. Look at me!").words
    found = spotter.spot(spoken) + spotter.flush()
    assert gestures(found) == ["everybody", "me"]
    assert found[1].stress == spoken[-1].stress


def test_a_phrase_has_no_pause_in_it(spotter):
    good, morning = words("good morning")
    later = Word("morning", morning.start + 0.3, morning.end + 0.3, morning.stress + 0.3)
    assert gestures(spotter.spot([good, later])) == ["yes"]
    assert gestures(spotter.flush()) == []
