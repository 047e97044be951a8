"""Keypoints to joint angles of any URDF robot, inside its limits.

A `Retargeter` takes clips of keypoints. It reduces each frame to directions, solves them for joint angles,
joins the frames with a spline, and lets a `Follower` keep the result inside the robot's limits.
"""
