"""One ROS node a file: parameters, topics, and calls into a room."""
