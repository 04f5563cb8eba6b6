"""Whether what a vehicle says of its velocity can be believed.

Between two moments the estimates of its place must have changed by the velocities in between,
summed up. Some vehicles say 0 whatever they do, so a velocity counts only once a robot that went
somewhere has gone as it said.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from netsp.arrays import Floats

SPAN_S, ENDS_S = 4.0, 1.0
"""Seconds between the moments, and for which places are averaged at each."""

FAR = 0.5
"""Share of the way at full speed that a robot must have gone for its velocities to be put to the
test."""

WRONG = 0.25
"""Share of the full speed by which velocities are wrong, beyond what the noise explains."""


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
        """The places before are of no use any more."""
        self._past.clear()

    def take(self, time: float, position: Floats, velocity: Floats) -> None:
        """What the vehicle says of both.

        Parameters
        ----------
        time : float
            Seconds.
        position : ndarray, shape (3,)
            Metres.
        velocity : ndarray, shape (3,)
            m/s.
        """
        past, gone = self._past, np.zeros(3)
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
        a, b = np.mean(first, axis=0), np.mean(last, axis=0)
        went, said = b - a
        off = float(np.linalg.norm((went - said)[:2]))
        noise = self.noise * math.sqrt(1.0 / len(first) + 1.0 / len(last))
        most = 4.0 * noise + WRONG * self.speed * SPAN_S
        if off > most:
            self.believed = False
        elif off <= 0.5 * most and np.linalg.norm(went[:2]) >= FAR * self.speed * SPAN_S:
            self.believed = True
