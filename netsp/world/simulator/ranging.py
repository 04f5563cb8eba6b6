"""Simulated range sensor: rays in a cone that end at the first solid."""

from __future__ import annotations

import math

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.compiled.kernel import kernel
from netsp.world.mission.equipment import RangeSensor
from netsp.world.scene.field import DistanceField
from netsp.world.scene.sampling import Field, distance
from netsp.world.simulator.environment_policy import RangingPolicy

RAY_TOLERANCE = 1e-3
"""Tolerance of sphere tracing: distance from a surface at which a ray has hit it, metres."""


def ray_fan(field_of_view: float, ahead: Floats, turn: float, ray_count: int) -> Floats:
    """Return unit vectors (n, 3) spread evenly in a cone: a Fibonacci spiral on a spherical cap.

    Parameters
    ----------
    field_of_view : float
        Full angle of the cone, degrees.
    ahead : ndarray, shape (3,)
        Axis of the cone, of any length.
    turn : float
        Angle by which the spiral is turned about the axis, rad.
    """
    k = np.arange(ray_count) + 0.5
    cosine = 1.0 - (1.0 - math.cos(math.radians(0.5 * field_of_view))) * k / ray_count
    sine = np.sqrt(1.0 - cosine**2)
    angle = math.pi * (1.0 + math.sqrt(5.0)) * k + turn
    w = ahead / np.linalg.norm(ahead)
    u = np.cross(w, [0.0, 0.0, 1.0] if abs(w[2]) < 0.9 else [1.0, 0.0, 0.0])
    u /= np.linalg.norm(u)
    v = np.cross(w, u)
    return np.asarray(
        np.outer(cosine, w) + np.outer(sine * np.cos(angle), u) + np.outer(sine * np.sin(angle), v)
    )


class Ranging:
    """Simulated range sensor; the seed determines its noise."""

    def __init__(
        self, sensor: RangeSensor, seed: int, policy: RangingPolicy = RangingPolicy()
    ) -> None:
        self.sensor, self.policy = sensor, policy
        self._rng = np.random.default_rng([seed, 2])

    def look(
        self, field: DistanceField, place: Floats, ahead: Floats
    ) -> tuple[Floats, Floats, Floats]:
        """Return one look from a place (3,) along a direction (3,) of any length.

        Returns
        -------
        rays : ndarray, shape (n, 3)
            Unit vectors.
        ranges : ndarray, shape (n,)
            Measured distance to the first solid on each ray, metres; inf beyond the range.
        errors : ndarray, shape (n,)
            Errors of these distances, metres.
        """
        turn = self._rng.uniform(0.0, 2.0 * math.pi)
        rays = ray_fan(self.sensor.field_of_view, ahead, turn, self.policy.ray_count)
        ranges = cast_rays(field.arrays, np.asarray(place, dtype=float), rays, self.sensor.range)
        noise = self.sensor.noise * self._rng.normal(size=len(rays))
        return rays, ranges + noise, noise


@kernel
def cast_rays(field: Field, place: Floats, rays: Floats, max_range: float) -> Floats:
    """Return the distance (n,) at which each ray (n, 3) meets a solid; inf beyond `max_range`.

    The method is sphere tracing.
    """
    out = np.full(len(rays), math.inf)
    for n in range(len(rays)):
        s = 0.0
        while s <= max_range:
            d = distance(
                field,
                place[0] + s * rays[n, 0],
                place[1] + s * rays[n, 1],
                place[2] + s * rays[n, 2],
            )
            if d < RAY_TOLERANCE:
                out[n] = s
                break
            s += d
    return out
