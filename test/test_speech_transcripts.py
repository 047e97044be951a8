from gesture_bot.speech.transcripts import Transcript


def test_each_word_is_told_once_as_soon_as_the_next_one_follows():
    transcript = Transcript()
    told = [
        transcript.incremental(text)
        for text in ("he", "hello", "hello my", "hello my frien", "hello my friend")
    ]
    assert told == [[], [], ["hello"], ["my"], []]
    assert transcript.final("hello my friend") == ["friend"]


def test_a_changed_mind_tells_nothing_twice_and_the_next_text_is_new():
    transcript = Transcript()
    assert transcript.incremental("i scream is") == ["i", "scream"]
    assert transcript.incremental("ice cream is good") == ["is"]
    assert transcript.final("ice cream") == []
    assert transcript.final("thank you") == ["thank", "you"]
