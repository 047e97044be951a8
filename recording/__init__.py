"""Recordings: what passed on the topics, in MCAP files that `ros2 bag`, rosbags and Foxglove read."""
