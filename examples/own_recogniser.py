"""Your own recogniser: words with their times on speech/words call the gestures of the semantic banks.

This one hears "hello" and "goodbye", with pocketsphinx: python examples/own_recogniser.py microphone.
"""

import sys
import tempfile
import time
from contextlib import suppress

import numpy as np
import rclpy
from pocketsphinx import Decoder
from rclpy.executors import ExternalShutdownException
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.time import Duration, Time

from gesture_bot.msg import Audio, Word

source = sys.argv[1] if len(sys.argv) > 1 else "microphone"
with tempfile.NamedTemporaryFile("w", suffix=".list") as phrases:
    phrases.write("hello /1e-5/\ngoodbye /1e-5/\n")  # how sure it has to be
    phrases.flush()
    decoder = Decoder(lm=None, kws=phrases.name, loglevel="FATAL")
decoder.start_utt()


def hear(sound: Audio) -> None:
    """Take in a piece of sound, at the 16 kHz of the microphone and of the robot's voice."""
    if sound.header.frame_id != source:
        return
    samples = np.array(sound.samples, np.float32)
    decoder.process_raw((32767 * samples).astype(np.int16).tobytes())
    if decoder.hyp():
        found = next(iter(decoder.seg()))
        # frame_id and utterance stay those of the sound: so the word finds its place beside it.
        word = Word(header=sound.header, utterance=sound.utterance, text=found.word.strip(), confidence=0.9)
        ago = 0.01 * (decoder.n_frames() - found.start_frame) - len(samples) / sound.sample_rate
        word.header.stamp = (Time.from_msg(sound.header.stamp) - Duration(seconds=ago)).to_msg()
        word.duration = 0.01 * (found.end_frame - found.start_frame)
        words.publish(word)
        print(word.text, flush=True)
        decoder.end_utt()
        decoder.start_utt()


rclpy.init()
node = rclpy.create_node("own_recogniser")
words = node.create_publisher(Word, "speech/words", 100)
stream = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)
audio = node.create_subscription(Audio, "speech/audio", hear, stream)
# A word that is published before somebody listens is lost.
while not (audio.get_publisher_count() and words.get_subscription_count()):
    time.sleep(0.1)
print("listens", flush=True)
with suppress(KeyboardInterrupt, ExternalShutdownException):
    rclpy.spin(node)
