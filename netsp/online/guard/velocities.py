"""Whether what a vehicle says of its velocity can be believed.

Between two moments the estimates of its place must have changed by the velocities in between,
summed up. Some vehicles say 0 whatever they do, so a velocity counts only once a robot that went
somewhere has gone as it said. In the plan: depth is known from pressure.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from netsp.base.arrays import Floats

SPAN_S, ENDS_S = 4.0, 1.0
"""Seconds between the moments, and for which places are averaged at each."""

FAR, CLEAR = 0.5, 4.0
"""Share of the way at full speed that a robot must have gone for its velocities to be put to the
test, and how many deviations of the noise, at least."""

WRONG = 0.25
"""Share of the full speed by which velocities are wrong, beyond what the noise explains."""

HALF = 0.5
"""Share of the way by which they are never right."""

HOLE_S = 2.0
"""Seconds without a velocity after which those before are of no use."""

FASTEST, NOISE = 1.5, 0.1
"""No robot is faster than so many times what it is said to be, but for four deviations of the noise
(m/s, of one estimate at ten a second; that of a Doppler log is a tenth of it, but a filter without
one knows no better)."""


class Velocities:
    """Compares them with places.

    Parameters
    ----------
    noise : float
        Standard deviation of one estimate of a place, metres.
    speed : float
        Fastest speed of the robot, m/s.
    """

    def __init__(self, noise: float, speed: float) -> None:
        self.noise, self.speed = noise, speed
        self.believed = False
        self._past: deque[tuple[float, Floats, Floats]] = deque()

    def begin(self) -> None:
        """What has been before is of no use any more."""
        self._past.clear()
        self.believed = False

    def possible(self, velocity: Floats) -> bool:
        """Whether the robot can be so fast.

        Parameters
        ----------
        velocity : ndarray, shape (2,)
            m/s.
        """
        return float(np.linalg.norm(velocity)) <= FASTEST * self.speed + 4.0 * NOISE

    def note_none(self, time: float) -> None:
        """A place came without one.

        Parameters
        ----------
        time : float
            Seconds.
        """
        if self._past and time - self._past[-1][0] > HOLE_S:
            self.begin()

    def take(self, time: float, position: Floats, velocity: Floats) -> None:
        """What the vehicle says of both.

        Parameters
        ----------
        time : float
            Seconds.
        position : ndarray, shape (2,)
            Metres.
        velocity : ndarray, shape (2,)
            m/s.
        """
        self.note_none(time)
        past, gone = self._past, np.zeros(2)
        if past:
            before, _, gone = past[-1]
            gone = gone + (time - before) * velocity
        past.append((time, position, gone))
        while len(past) > 2 and time - past[1][0] >= SPAN_S + ENDS_S:
            past.popleft()
        if time - past[0][0] < SPAN_S + 0.8 * ENDS_S:
            return
        first = [(p, g) for t, p, g in past if t <= past[0][0] + ENDS_S]
        last = [(p, g) for t, p, g in past if t >= time - ENDS_S]
        went, said = np.mean(last, axis=0) - np.mean(first, axis=0)
        off, way = float(np.linalg.norm(went - said)), float(np.linalg.norm(went))
        noise = self.noise * math.sqrt(1.0 / len(first) + 1.0 / len(last))
        most = 4.0 * noise + WRONG * self.speed * SPAN_S
        longer = max(way, float(np.linalg.norm(said)))
        if off > most or off > max(HALF * longer, CLEAR * noise):
            self.believed = False
        elif off <= HALF * min(most, way):
            enough = max(FAR * self.speed * SPAN_S, CLEAR * noise)
            self.believed = self.believed or way >= enough
