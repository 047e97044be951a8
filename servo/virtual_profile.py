"""The motion profile of a virtual servo: how it goes from one Goal Position (116) to the next.

Source: e-Manual of the X series, "What is the Profile".
"""

import math

STEP, RECTANGULAR, TRIANGULAR, TRAPEZOIDAL = range(4)
"""Types of profile, as Moving Status (123) shows them."""


class Profile:
    """The desired trajectory of a position controller.

    Attributes:
        position: [ticks].
        velocity: [ticks/s].
        kind: Type of the last profile, such as TRAPEZOIDAL.
    """

    def __init__(self, position: float):
        self.position = position
        self.velocity = 0.0
        self.kind = STEP
        self._goal = position
        self._pieces: list[tuple[float, float]] = []

    @property
    def ongoing(self) -> bool:
        """Whether the goal is still ahead."""
        return bool(self._pieces)

    def begin(self, goal: float, speed: float, acceleration: float) -> None:
        """Go to a goal from now on; with an acceleration, the velocity does not jump ("Velocity Override").

        Args:
            goal: [ticks].
            speed: Largest speed [ticks/s]; 0 is no profile: a step.
            acceleration: Size of the acceleration [ticks/s^2]; 0 is an infinite one.
        """
        self._goal, self._pieces = goal, []
        distance = goal - self.position
        if not speed:
            self.kind = STEP
            self.position, self.velocity = goal, 0.0
        elif not acceleration:
            self.kind = RECTANGULAR
            self.velocity = math.copysign(speed, distance)
            self._pieces = [(abs(distance) / speed, 0.0)]
        else:
            self._ramp(distance, speed, acceleration)

    def begin_timed(self, goal: float, duration: float, ramp: float) -> None:
        """As `begin`, for a time-based profile. Where the joint moves already, the time is not kept exactly.

        Args:
            goal: [ticks].
            duration: From the start to the goal [s]; 0 is a step.
            ramp: Time to accelerate, and to brake, at most half of it [s].
        """
        ramp = min(ramp, duration / 2)
        speed = abs(goal - self.position) / (duration - ramp) if duration else 0.0
        self.begin(goal, speed, speed / ramp if ramp else 0.0)

    def _ramp(self, distance: float, speed: float, acceleration: float) -> None:
        # Forward is where the goal lies when seen from where the joint could stop.
        stopping = self.velocity * abs(self.velocity) / (2 * acceleration)
        forward = math.copysign(1.0, distance - stopping)
        entry, ahead = forward * self.velocity, forward * distance
        peak = math.sqrt(max(acceleration * ahead + entry * entry / 2, 0.0))
        self.kind = TRIANGULAR if peak < speed else TRAPEZOIDAL
        peak = min(peak, speed)
        change = math.copysign(acceleration, peak - entry)
        ramps = (peak * peak - entry * entry) / (2 * change) + peak * peak / (2 * acceleration)
        cruise = max(ahead - ramps, 0.0) / peak if peak else 0.0
        self._pieces = [
            ((peak - entry) / change, forward * change),
            (cruise, 0.0),
            (peak / acceleration, -forward * acceleration),
        ]

    def advance(self, seconds: float) -> None:
        """Let time pass."""
        while self._pieces:
            duration, acceleration = self._pieces[0]
            passed = min(seconds, duration)
            self.position += (self.velocity + acceleration * passed / 2) * passed
            self.velocity += acceleration * passed
            seconds -= passed
            if passed < duration:
                self._pieces[0] = (duration - passed, acceleration)
                return
            del self._pieces[0]
            if not self._pieces:  # without the rounding of the sums
                self.position, self.velocity = self._goal, 0.0
