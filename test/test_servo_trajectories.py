"""The overlay: what continues the plan is followed exactly, and no thread sees it half-changed."""

import sys
import threading

import numpy as np

from gesture_bot.base.trajectory import JointTrajectory
from gesture_bot.servo.trajectories import Overlay

T0 = 1.7e9


def swing(start):
    """Half a second of a swing that is the same whenever it is sent."""
    times = start + np.arange(0, 0.51, 0.02)
    phase = (times - T0)[:, None] + [0, 1]
    return JointTrajectory(("a", "b"), times, np.sin(phase), np.cos(phase))


def test_a_plan_that_is_sent_again_and_again_is_followed_exactly():
    overlay = Overlay(("a", "b"), half_life=0.3)
    for now in T0 + np.arange(0, 20, 0.1):
        overlay.add(swing(now + 0.3), now)
    times = now + np.linspace(0.3, 0.8, 100)
    for planned, sent in zip(overlay.at(times), swing(now + 0.3).at(times), strict=True):
        np.testing.assert_allclose(planned, sent, atol=1e-5)


def test_a_plan_can_be_asked_for_while_it_changes():
    overlay = Overlay(("a", "b"), half_life=0.3)
    overlay.add(swing(T0), T0)

    def change():
        for now in T0 + np.arange(0, 10, 0.02):
            overlay.add(swing(now), now)

    changing, switching = threading.Thread(target=change), sys.getswitchinterval()
    sys.setswitchinterval(1e-5)
    changing.start()
    try:
        while changing.is_alive():
            assert np.isfinite(overlay.at(np.array([T0 + 20]))[0]).all()
    finally:
        changing.join()
        sys.setswitchinterval(switching)
