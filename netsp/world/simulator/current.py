"""Moving water: a steady current, with gusts on top."""

from __future__ import annotations

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.field_types import Point3
from netsp.world.simulator.environment_policy import GustPolicy


class Water:
    """Velocity of the water over time; gusts are an Ornstein-Uhlenbeck process with a seed.

    Parameters
    ----------
    current
        Mean velocity (3,), m/s.
    gusts
        Standard deviation along each axis, m/s.
    """

    def __init__(
        self, current: Point3, gusts: float, seed: int, policy: GustPolicy = GustPolicy()
    ) -> None:
        self.current = np.array(current, dtype=float)
        self.gusts, self.policy = gusts, policy
        self._rng = np.random.default_rng(seed)
        self._values = [gusts * self._rng.normal(size=3)]

    def __call__(self, now: float) -> Floats:
        """Return the velocity (3,) at a time in seconds, m/s."""
        if self.gusts == 0.0:
            return self.current
        interval_s = self.policy.interval_s
        keep = np.exp(-interval_s / self.policy.memory_s)
        while len(self._values) <= now / interval_s:
            noise = self.gusts * np.sqrt(1.0 - keep**2) * self._rng.normal(size=3)
            self._values.append(keep * self._values[-1] + noise)
        return np.asarray(self.current + self._values[int(now / interval_s)])
