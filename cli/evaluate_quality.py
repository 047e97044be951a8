"""`gesture-bot evaluate quality`: MM22's table 3 in numbers."""

import argparse

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.corpus.demo import load_database
from gesture_bot.evaluate.performances import held_performances, recorded_performances
from gesture_bot.evaluate.quality import Quality, quality_table
from gesture_bot.evaluate.quality_files import markdown, write_quality
from gesture_bot.refine.model import load_model

_NOTES = """\
{minutes:.1f} minutes of recorded motion in {pieces} pieces; in brackets 95% intervals (bootstrap).
*             differs from smoothing alone by more than the interval of the difference
MAJE, MAD     distance from the speaker's own motion, in place and in acceleration (RG22)
FGD           Frechet distance of windows' latents; kinematic FD: of speeds and places, without a network.
              Each half of the pieces is compared with the recorded motion of the other half: the first row
              is the floor
PMB           share of the hands' beats within so many seconds of a beat of the speech (RG22: 0.2 s). Chance
              is the second row. Motion with fewer beats has more of them matched, and jumps where windows
              meet unsmoothed count as beats
diversity     entropy over the gestures of a lexicon of 50 (log2 50 = 5.64)
acceleration, jerk: means of both wrists; at seams: over the place where two windows meet"""


def command(options: argparse.Namespace) -> int:
    """Print the table for `options.database` and `options.speech`, and write it; the exit status.

    Raises:
        GestureBotError: A file cannot be read or written, or there is too little motion in it.
    """
    database = load_database(options.database)
    if options.speech:
        performances = recorded_performances(options.speech, database)
    elif options.database == "demo":
        performances = held_performances()
    else:
        raise InvalidValueError(
            "a database of yours is judged by recordings that it does not hold: --speech FILE ..."
        )
    model = load_model(options.model, database)
    quality = quality_table(database, performances, model)
    print(markdown(quality), _notes(quality), sep="\n\n")
    if options.output:
        for path in write_quality(options.output, quality, _notes(quality)):
            print(f"wrote {path}")
    return 0


def _notes(quality: Quality) -> str:
    return _NOTES.format(minutes=quality.minutes, pieces=quality.pieces)
