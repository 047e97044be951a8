"""Swing one joint, without ROS: python examples/swing_joint.py mine.yaml left_elbow /dev/ttyUSB0.

Without a port, it is on a virtual bus: python examples/swing_joint.py toa left_elbow.
"""

import sys
import time
from contextlib import nullcontext

import numpy as np

from gesture_bot.base.trajectory import JointTrajectory
from gesture_bot.retarget.robot import load_robot
from gesture_bot.servo.driver import Driver
from gesture_bot.servo.virtual_bus import VirtualBus

RATE = 100.0  # bus cycles a second [Hz]
SWING, PERIOD = 0.2, 3.0  # how far it goes, toward the middle of its range [rad], and how long that takes [s]

robot, joint, *ports = load_robot(sys.argv[1]), *sys.argv[2:]
if joint not in robot.joints:
    sys.exit(f"{robot.name} has no joint {joint}; it has {', '.join(robot.joints)}")
column = robot.joints.index(joint)
middle = (robot.limits.lower[column] + robot.limits.upper[column]) / 2
with VirtualBus(robot) if not ports else nullcontext() as bus:
    driver = Driver(robot, ports[0] if ports else bus.port, RATE)
    driver.start()  # checks every servo; torque goes on, and holds each joint where it is
    try:
        angles = [driver.tick(time.time()).positions[column]]
        begin, way = time.time() + 0.5, np.copysign(SWING, middle - angles[0])
        phase = np.linspace(0.0, 2 * np.pi, 60)[:, None]
        positions = angles[0] + way * (1 - np.cos(phase)) / 2
        velocities = way * np.sin(phase) * np.pi / PERIOD
        times = begin + PERIOD * phase[:, 0] / phase[-1]
        # The driver keeps limits, speeds and distances, whatever is asked for. The other joints hold.
        driver.set_trajectory(JointTrajectory((joint,), times, positions, velocities))
        for due in np.arange(begin, begin + PERIOD + 0.5, 1 / RATE):
            time.sleep(max(0.0, due - time.time()))
            angles.append(driver.tick(time.time()).positions[column])
    finally:
        driver.close()  # to rest, then torque off, or as `on_exit` in the robot's file says
farthest = max(angles, key=lambda angle: abs(angle - angles[0]))
print(f"{joint} went from {angles[0]:.2f} rad to {farthest:.2f} rad and back to {angles[-1]:.2f} rad")
