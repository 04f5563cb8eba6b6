"""Distances by the names of TSPLIB, rounded as TSPLIB rounds them.

Source: Reinelt, "TSPLIB95" (1995), section 2. Its functions are in C, where a cast to int cuts off
the fraction; `nint(x)` is ``(int) (x + 0.5)``.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from netsp.base.arrays import Floats

Differences = Floats
"""(k, n, n) differences of each coordinate."""


def _nint(x: Floats) -> Floats:
    return np.floor(x + 0.5)


def _differences(places: Floats) -> Differences:
    return np.abs(places.T[:, :, None] - places.T[:, None, :])


def _euclidean(places: Floats) -> Floats:
    return np.asarray(np.sqrt((_differences(places) ** 2).sum(axis=0)))


def _manhattan(places: Floats) -> Floats:
    return _nint(_differences(places).sum(axis=0))


def _maximum(places: Floats) -> Floats:
    return np.asarray(_nint(_differences(places)).max(axis=0))


def _pseudo_euclidean(places: Floats) -> Floats:
    r = _euclidean(places) / np.sqrt(10.0)
    t = _nint(r)
    return np.where(t < r, t + 1.0, t)


TSPLIB_PI = 3.141592
"""Format of TSPLIB: its value of pi."""

TSPLIB_RADIUS_KM = 6378.388
"""Format of TSPLIB: its radius of the earth, km."""


def _geographical(places: Floats) -> Floats:
    """Return distances between places in degrees and minutes, as DDD.MM.

    TSPLIB's document rounds the degrees; its published optima are those of truncated degrees, which
    solvers therefore use.
    """
    degrees = np.trunc(places)
    radians = TSPLIB_PI * (degrees + 5.0 * (places - degrees) / 3.0) / 180.0
    latitude, longitude = radians.T
    q1 = np.cos(longitude[:, None] - longitude[None, :])
    q2 = np.cos(latitude[:, None] - latitude[None, :])
    q3 = np.cos(latitude[:, None] + latitude[None, :])
    inner = np.clip(0.5 * ((1.0 + q1) * q2 - (1.0 - q1) * q3), -1.0, 1.0)
    return np.asarray(np.trunc(TSPLIB_RADIUS_KM * np.arccos(inner) + 1.0))


METRICS: dict[str, tuple[int, Callable[[Floats], Floats]]] = {
    "EUC_2D": (2, lambda p: _nint(_euclidean(p))),
    "EUC_3D": (3, lambda p: _nint(_euclidean(p))),
    "CEIL_2D": (2, lambda p: np.ceil(_euclidean(p))),
    "MAN_2D": (2, _manhattan),
    "MAN_3D": (3, _manhattan),
    "MAX_2D": (2, _maximum),
    "MAX_3D": (3, _maximum),
    "ATT": (2, _pseudo_euclidean),
    "GEO": (2, _geographical),
}
"""Name → number k of coordinates, and function from places (n, k) to distances (n, n)."""
