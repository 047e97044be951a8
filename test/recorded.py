"""Recordings for the tests: messages in, an MCAP file out."""

from pathlib import Path

from rclpy.serialization import serialize_message

from gesture_bot.recording.writer import RecordingWriter


def type_name(message) -> str:
    return f"{type(message).__module__.split('.')[0]}/msg/{type(message).__name__}"


def write_recording(path: Path, messages) -> Path:
    """Write (topic, moment of arrival [s since the epoch], message) in the order of arrival."""
    writer = RecordingWriter(path)
    channels = {}
    for topic, arrival, message in sorted(messages, key=lambda entry: entry[1]):
        if topic not in channels:
            channels[topic] = writer.add_topic(topic, type_name(message), [])
        moment = round(arrival * 1e9)
        writer.write(channels[topic], moment, moment, serialize_message(message))
    writer.close()
    return path
