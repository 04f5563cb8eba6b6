"""What a range sensor sees: where rays in a cone first meet something."""

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


def fan(field_of_view: float, ahead: Floats, turn: float, ray_count: int) -> Floats:
    """Rays that share a cone evenly: a spiral of Fibonacci on the cap of the sphere.

    Parameters
    ----------
    field_of_view : float
        Full angle of the cone, degrees.
    ahead : ndarray, shape (3,)
        Its axis, of any length.
    turn : float
        Radians by which the spiral is turned about it.

    Returns
    -------
    ndarray, shape (n, 3)
        Unit vectors.
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
    """Looks of a range sensor.

    Parameters
    ----------
    sensor : RangeSensor
        Its range, cone and noise.
    seed : int
        Of the noise.
    """

    def __init__(
        self, sensor: RangeSensor, seed: int, policy: RangingPolicy = RangingPolicy()
    ) -> None:
        self.sensor, self.policy = sensor, policy
        self._rng = np.random.default_rng([seed, 2])

    def look(
        self, field: DistanceField, place: Floats, ahead: Floats
    ) -> tuple[Floats, Floats, Floats]:
        """One look.

        Parameters
        ----------
        field : DistanceField
            What is there.
        place : ndarray, shape (3,)
            Of the sensor, metres.
        ahead : ndarray, shape (3,)
            Where it looks, of any length.

        Returns
        -------
        rays : ndarray, shape (n, 3)
            Unit vectors.
        ranges : ndarray, shape (n,)
            Metres to what each meets first, as measured; inf where that is nothing within the
            range.
        off : ndarray, shape (n,)
            Metres by which these are wrong.
        """
        turn = self._rng.uniform(0.0, 2.0 * math.pi)
        rays = fan(self.sensor.field_of_view, ahead, turn, self.policy.ray_count)
        ranges = cast(field.arrays, np.asarray(place, dtype=float), rays, self.sensor.range)
        noise = self.sensor.noise * self._rng.normal(size=len(rays))
        return rays, ranges + noise, noise


@kernel
def cast(field: Field, place: Floats, rays: Floats, most: float) -> Floats:
    """(n,) how far along each ray (n, 3) something is; inf beyond `most` (sphere tracing)."""
    out = np.full(len(rays), math.inf)
    for n in range(len(rays)):
        s = 0.0
        while s <= most:
            d = distance(
                field, place[0] + s * rays[n, 0], place[1] + s * rays[n, 1],
                place[2] + s * rays[n, 2],
            )  # fmt: skip
            if d < RAY_TOLERANCE:
                out[n] = s
                break
            s += d
    return out
