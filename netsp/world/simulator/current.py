"""Moving water: a steady current, and gusts on top of it that come and go."""

from __future__ import annotations

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.field_types import Point3
from netsp.world.simulator.environment_policy import GustPolicy


class Water:
    """Velocity over time; gusts are an Ornstein-Uhlenbeck process, the same for the same seed.

    Parameters
    ----------
    current
        (3,) m/s.
    gusts
        m/s, standard deviation along each axis.
    """

    def __init__(
        self, current: Point3, gusts: float, seed: int, policy: GustPolicy = GustPolicy()
    ) -> None:
        self.current = np.array(current, dtype=float)
        self.gusts, self.policy = gusts, policy
        self._rng = np.random.default_rng(seed)
        self._values = [gusts * self._rng.normal(size=3)]

    def __call__(self, now: float) -> Floats:
        """(3,) m/s at a time in seconds."""
        if self.gusts == 0.0:
            return self.current
        interval_s = self.policy.interval_s
        keep = np.exp(-interval_s / self.policy.memory_s)
        while len(self._values) <= now / interval_s:
            noise = self.gusts * np.sqrt(1.0 - keep**2) * self._rng.normal(size=3)
            self._values.append(keep * self._values[-1] + noise)
        return np.asarray(self.current + self._values[int(now / interval_s)])
