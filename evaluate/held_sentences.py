"""Sentences to measure with, none of which the demo corpus was made from."""

from collections.abc import Iterable

import numpy as np

from gesture_bot.speech.audio import SAMPLE_RATE
from gesture_bot.speech.voice import load_voice

PAUSE = 0.5
"""Silence after each sentence [s]."""

HELD_SENTENCES = (
    "Good evening, and thank you for finding your way here in such weather.",
    "The new tram line runs from the harbour to the hospital every seven minutes.",
    "My sister plants potatoes between the roses, and both of them seem to like it.",
    "If the battery runs low, the lamp on my shoulder begins to blink.",
    "We measured the room twice, and each time the table was too long for it.",
    "There is a short way through the woods and a pretty way along the river.",
    "He folded the map, put it into his coat, and asked the driver to wait.",
    "Nobody had told us that the museum closes on Tuesdays.",
    "First you knead the dough, then you leave it alone, and then you knead it again.",
    "The choir sings on the stairs because the hall has no heating.",
    "A heavy box belongs on the lowest shelf, a light one wherever there is room.",
    "Please hold the rope with both hands until I tell you to let go.",
    "The shop on the corner repairs radios, umbrellas and old wooden toys.",
    "Between one and two o'clock the whole village is asleep.",
    "I counted eleven swans on the way here, and one very angry goose.",
    "Your parcel came back because the street has two names.",
    "The bridge swings a little in the wind, which is exactly what it should do.",
    "She learned to sail on a lake that is not much wider than this square.",
    "Turn the big wheel slowly, and stop as soon as the needle moves.",
    "Some of the apples are sour, others are sweet, and a few are simply too hard.",
    "In the second act the king loses his crown, his coat and his temper.",
    "The nurse spoke softly, and after a while the child let go of the bear.",
    "It is quite a climb, yet from the top you can see three countries.",
    "We could paint the door green, or leave it as it has always been.",
    "The engine makes a sound like rain on a tin roof when it is cold.",
    "Every spring the river takes a piece of our garden and gives a piece to theirs.",
    "You will find the keys in the blue jar behind the flour.",
    "A long time ago people crossed these hills with salt on their backs.",
    "He wrote one letter a week, on Sundays, and never about himself.",
    "Let me show you how the drawer opens, because there is a trick to it.",
    "The lighthouse has not been lit for years, but the stairs are still swept.",
    "Half of the class wanted to go swimming, and the other half wanted to sleep.",
    "Take the small spoon for the sugar and the large one for everything else.",
    "The clock in the station is two minutes fast, so that nobody misses a train.",
    "Her grandfather built violins in the kitchen, with the window open all winter.",
    "What looks like a stone on the beach may well be a very old brick.",
    "On the left side you see the harvest, on the right side the feast.",
    "They moved the piano across the street with four men and a great deal of shouting.",
    "The coffee here is strong, and the chairs are made for short visits.",
    "Before we go home, each of us says one thing that went well today.",
)
"""Two and a half minutes of everyday speech."""


def held_speech() -> np.ndarray:
    """Samples of all of them in the embedded voice, with pauses."""
    voice = load_voice("embedded")
    return with_pauses(voice.speak(sentence).samples for sentence in HELD_SENTENCES)


def with_pauses(parts: Iterable[np.ndarray]) -> np.ndarray:
    """Sounds one after another, with a PAUSE after each."""
    pause = np.zeros(round(PAUSE * SAMPLE_RATE), np.float32)
    return np.concatenate([samples for part in parts for samples in (part, pause)])
