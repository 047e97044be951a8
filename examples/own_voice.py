"""Your own voice: any program that publishes its sound and its words makes the robot gesture to them."""

import time

import rclpy
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.time import Time
from std_msgs.msg import Header

from gesture_bot.msg import Audio, Word
from gesture_bot.speech.voice import load_voice

RATE, PIECE = 16_000, 1_600  # any rate will do; pieces of 0.1 s


def synthesise(text):
    """Put your own voice here: samples, and (word, start [s], end [s]) of each word."""
    said = load_voice("embedded").speak(text)
    return said.samples, [(word.text, word.start, word.end) for word in said.words]


def heard_at(moment):
    """The header of what is heard at a moment [s since the epoch]."""
    return Header(stamp=Time(nanoseconds=round(moment * 1e9)).to_msg(), frame_id="my_voice")


rclpy.init()
node = rclpy.create_node("own_voice")
stream = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)
audio = node.create_publisher(Audio, "speech/audio", stream)
words = node.create_publisher(Word, "speech/words", 100)
samples, said = synthesise("Hello, this is a voice of my own.")
while "feature_streamer" not in [
    one.node_name for one in node.get_subscriptions_info_by_topic("speech/audio")
]:
    time.sleep(0.1)
time.sleep(0.5)  # sound is best effort: what comes before it listens is lost
# Play your sound at `start`. Announced two seconds ahead, its strokes are prepared, and fall on its words.
start = time.time() + 2.5
for text, begin, end in said:
    words.publish(Word(header=heard_at(start + begin), text=text, duration=end - begin, confidence=1.0))
for at in range(0, len(samples), PIECE):
    time.sleep(max(0.0, start + at / RATE - 2.0 - time.time()))
    piece, last = samples[at : at + PIECE].tolist(), at + PIECE >= len(samples)
    # Count `utterance` up with each text, here and in its words.
    audio.publish(Audio(header=heard_at(start + at / RATE), sample_rate=RATE, samples=piece, last=last))
