"""Measured position of the robot: with delay and noise, and filtered."""

from __future__ import annotations

import numpy as np

from netsp.base.arrays import Floats
from netsp.world.mission.equipment import PositionSensor
from netsp.world.scene.field import DistanceField, pushed_out
from netsp.world.simulator.simulation_policy import SimulationPolicy


class Positions:
    """Positions measured step by step and filtered; never inside a solid.

    The filter is an alpha-beta filter (Bar-Shalom, Li & Kirubarajan, "Estimation with Applications
    to Tracking and Navigation", 2001, section 6.5), critically damped. The estimated velocity
    compensates the delay of the positions.

    Parameters
    ----------
    place : ndarray, shape (3,)
        First position, which is known exactly, metres.
    """

    def __init__(
        self,
        sensor: PositionSensor,
        field: DistanceField,
        place: Floats,
        seed: int,
        policy: SimulationPolicy = SimulationPolicy(),
    ) -> None:
        self.sensor, self.field, self.policy = sensor, field, policy
        self._late = round(sensor.delay / policy.step_s)
        self._true = [np.array(place, dtype=float)]
        self._estimate, self._velocity = self._true[0].copy(), np.zeros(3)
        self._rng = np.random.default_rng([seed, 1])

    @property
    def exact(self) -> bool:
        """True if positions have no noise and no delay."""
        return self.sensor.noise == 0.0 and self._late == 0

    def __call__(self, place: Floats) -> Floats:
        """Return the estimated position (3,) of a robot at a place (3,), metres."""
        if self.exact:
            return place
        self._true.append(np.array(place, dtype=float))
        old = self._true[max(0, len(self._true) - 1 - self._late)]
        measured = old + self.sensor.noise * self._rng.normal(size=3)
        step_s, gain = self.policy.step_s, self.policy.position_gain
        ahead = self._estimate + step_s * self._velocity
        off = measured - ahead
        self._estimate = ahead + gain * off
        self._velocity += gain**2 / (2.0 - gain) / step_s * off
        now = self._estimate + self._late * step_s * self._velocity
        return np.asarray(pushed_out(self.field, now[None], 1e-3)[0])
