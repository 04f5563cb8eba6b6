"""BlueROV2 that follows a path by model-predictive control."""

from __future__ import annotations

import math
import time

import numpy as np

from netsp.base.arrays import Floats
from netsp.world.vehicle.control import PredictiveControl
from netsp.world.vehicle.dynamics import step
from netsp.world.vehicle.kinematic import advance_along, wrapped_angle
from netsp.world.vehicle.vehicle_policy import VehiclePolicy

TOP_SPEED = 1.5
"""Physical constant: top speed ahead that Blue Robotics states, m/s."""


class BlueRov2:
    """BlueROV2, its controller, and its estimate of the current.

    The controller does not know the velocity of the water; it infers it from the drift.
    """

    def __init__(
        self, place: Floats, speed: float, policy: VehiclePolicy = VehiclePolicy()
    ) -> None:
        self.policy = policy
        self.state = np.zeros(8)
        self.state[:3] = place
        self.speed = min(speed, TOP_SPEED)
        self.control_s: list[float] = []
        self._control = PredictiveControl(policy.control)
        self._followed = np.array(place, dtype=float)
        self._drift = np.zeros(3)
        # load compiled code before the first step
        aims = np.tile(self.state, (policy.control.horizon, 1))
        self._control.force(self.state, aims, self._drift)
        self._control = PredictiveControl(policy.control)

    @property
    def position(self) -> Floats:
        """Position (3,), metres."""
        return self.state[:3].copy()

    @property
    def yaw(self) -> float:
        """Heading, rad."""
        return float(self.state[3])

    def go(
        self,
        path: Floats,
        seconds: float,
        yaw: float,
        water: Floats,
        fresh: bool,
        pull: Floats | None = None,
    ) -> tuple[list[Floats], int]:
        """See `netsp.world.vehicle.Vehicle`."""
        points, behind, policy, step_s = [], 0, self.policy, self.policy.control.step_s
        if fresh:
            self._followed = self.position
        for _ in range(max(1, round(seconds / step_s))):
            begin = time.perf_counter()
            lead = float(np.linalg.norm(self._followed - self.position))
            on, passed = advance_along(
                self._followed,
                path[behind:],
                min(self.speed * step_s, max(0.0, policy.max_lead - lead)),
            )
            self._followed = on[-1]
            behind += passed
            force = self._control.force(self.state, self._aims(path[behind:], yaw), self._drift)
            expected = step(self.state, force, self._drift, step_s)
            self.control_s.append(time.perf_counter() - begin)
            for _ in range(policy.integration_steps):
                both = force if pull is None else force + self._in_frame(pull)
                self.state = step(self.state, both, water, step_s / policy.integration_steps)
            self._drift += policy.drift_gain * (self.state[:3] - expected[:3]) / step_s
            points.append(self.position)
        return points, behind

    def _in_frame(self, pull: Floats) -> Floats:
        """Return a force (3,) of the world as an input (4,) of the vehicle."""
        c, s = math.cos(self.state[3]), math.sin(self.state[3])
        return np.array([c * pull[0] + s * pull[1], -s * pull[0] + c * pull[1], pull[2], 0.0])

    def stop_at(self, place: Floats) -> None:
        """See `netsp.world.vehicle.Vehicle`."""
        self.state[:3] = place
        self.state[4:] = 0.0
        self._followed = np.array(place)

    def _aims(self, path: Floats, yaw: float) -> Floats:
        """Return (horizon, 8) the places and velocities of the followed point, with the heading."""
        horizon, step_s = self.policy.control.horizon, self.policy.control.step_s
        aims = np.zeros((horizon, 8))
        heading = self.state[3] + wrapped_angle(yaw - self.state[3])
        c, s = math.cos(heading), math.sin(heading)
        at, rest = self._followed, path
        for k in range(horizon):
            if k > 0:
                on, passed = advance_along(at, rest, self.speed * step_s)
                velocity = (on[-1] - at) / step_s - self._drift
                at, rest = on[-1], rest[passed:]
            else:
                velocity = -self._drift
                if len(rest) and (far := float(np.linalg.norm(rest[0] - at))) > 0.0:
                    velocity = velocity + (rest[0] - at) * (self.speed / far)
            aims[k, :3], aims[k, 3] = at, heading
            aims[k, 4] = c * velocity[0] + s * velocity[1]
            aims[k, 5] = -s * velocity[0] + c * velocity[1]
            aims[k, 6] = velocity[2]
        return aims
