"""Recordings: everything that passed on the topics, in an MCAP file as `ros2 bag`, rosbags and Foxglove read it."""
