"""BlueROV2 that follows a path by model-predictive control."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator

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
        self._pace, self._heading = 1.0, 0.0
        self._drift = np.zeros(3)
        # load compiled code before the first step
        aims = np.tile(self.state, (policy.control.horizon, 1))
        self._control.force(self.state, aims, self._drift)
        self._control.error(self._control.guess, self.state, aims, self._drift)
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
            force, passed = self._followed_on(path[behind:], yaw)
            behind += passed
            expected = step(self.state, force, self._drift, step_s)
            self.control_s.append(time.perf_counter() - begin)
            for _ in range(policy.integration_steps):
                both = force if pull is None else force + self._in_frame(pull)
                self.state = step(self.state, both, water, step_s / policy.integration_steps)
            self._drift += policy.drift_gain * (self.state[:3] - expected[:3]) / step_s
            points.append(self.position)
        return points, behind

    def _followed_on(self, path: Floats, yaw: float) -> tuple[Floats, int]:
        """Move the followed point on along a path (k, 3), at the fastest pace at which the vehicle
        keeps up with it.

        A reference governor (Garone, Di Cairano and Kolmanovsky, "Reference and command governors
        for systems with constraints", Automatica 75, 2017): a pace is accepted if the model stays
        within `max_lead` of a point that moves on at this pace for the next `lead_steps`. At pace 0
        the point waits and the vehicle comes to it, so that it can move on.

        Returns
        -------
        force : ndarray, shape (4,)
            Input of the next step.
        passed : int
            Number of points of the path that the followed point has passed.
        """
        policy, control, state, water = self.policy, self._control, self.state, self._drift
        thrusts = control.guess
        for pace in self._paces():
            speed = self.speed * pace
            on, passed = advance_along(self._followed, path, speed * policy.control.step_s)
            aims = self._aims(on[-1], path[passed:], yaw, speed)
            for _ in range(policy.max_iterations):
                thrusts = control.improved(thrusts, state, aims, water)
                error = control.error(thrusts[: policy.lead_steps], state, aims, water)
                is_close = error <= policy.max_lead
                if is_close:
                    break
            if is_close:
                break
        self._pace, self._followed = pace, on[-1]
        self._heading = self._turned_towards(yaw, self._heading)
        return control.apply(thrusts), passed

    def _paces(self) -> Iterator[float]:
        """Yield the paces to try, as shares of the cruise speed, from the fastest one down to 0."""
        policy = self.policy
        pace = max(self._pace, policy.min_pace)
        yield min(1.0, policy.pace_growth * pace)
        while pace >= policy.min_pace:
            yield pace
            pace *= policy.pace_cut
        yield 0.0

    def _in_frame(self, pull: Floats) -> Floats:
        """Return a force (3,) of the world as an input (4,) of the vehicle."""
        c, s = math.cos(self.state[3]), math.sin(self.state[3])
        return np.array([c * pull[0] + s * pull[1], -s * pull[0] + c * pull[1], pull[2], 0.0])

    def stop_at(self, place: Floats) -> None:
        """See `netsp.world.vehicle.Vehicle`."""
        self.state[:3] = place
        self.state[4:] = 0.0
        self._followed, self._heading = np.array(place), self.yaw

    def _aims(self, start: Floats, path: Floats, yaw: float, speed: float) -> Floats:
        """Return (horizon, 8) the states of a point that moves on along a path (k, 3) at a speed,
        m/s, and turns to a heading, rad."""
        horizon, step_s = self.policy.control.horizon, self.policy.control.step_s
        aims = np.zeros((horizon, 8))
        at, rest, heading = start, path, self._heading
        for k in range(horizon):
            turned = self._turned_towards(yaw, heading)
            rate, heading = (turned - heading) / step_s, turned
            if k > 0:
                on, passed = advance_along(at, rest, speed * step_s)
                velocity = (on[-1] - at) / step_s - self._drift
                at, rest = on[-1], rest[passed:]
            else:
                velocity = -self._drift
                if len(rest) and (far := float(np.linalg.norm(rest[0] - at))) > 0.0:
                    velocity = velocity + (rest[0] - at) * (speed / far)
            c, s = math.cos(heading), math.sin(heading)
            aims[k, :3], aims[k, 3] = at, heading
            aims[k, 4] = c * velocity[0] + s * velocity[1]
            aims[k, 5] = -s * velocity[0] + c * velocity[1]
            aims[k, 6], aims[k, 7] = velocity[2], rate
        return aims

    def _turned_towards(self, yaw: float, heading: float) -> float:
        """Return a heading, rad, after one control step of turning to another."""
        max_turn = math.radians(self.policy.max_turn_rate_deg) * self.policy.control.step_s
        return heading + min(max(wrapped_angle(yaw - heading), -max_turn), max_turn)
