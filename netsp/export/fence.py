"""Fence of a plan: obstacles as exclusion zones that fit into the vehicle's storage.

ArduPilot stores a fence as records of bytes: a head and an end, for a circle its kind, two
coordinates and the radius, for a polygon its kind, the number of its corners and two coordinates
for each. So the bytes are limited, not the points: a flight controller of the Pixhawk family
without a card takes 51 circles, or one polygon of 83 corners.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from netsp.arrays import Floats
from netsp.errors import InputError
from netsp.fields import Point2
from netsp.problem import Circle, Polygon, Problem

GROWTH_STEPS = 8
"""Number of tolerances that are tried before an obstacle is left out, at least 1."""

MIN_FENCE_BYTES = 18
"""Bytes of the smallest fence that holds anything: head, end and one circle."""

QUARTER_SEGMENTS = 16
"""Corners of a quarter circle where growth is checked: the limit is 0.5 % low there."""


@dataclass(frozen=True)
class FencePolicy:
    """Policy of what a fence may take.

    Attributes
    ----------
    max_bytes
        Storage of the vehicle for its fence, bytes; 672 on flight controllers of the Pixhawk family
        without a card, where ArduSub 4.7 was seen to take 51 circles. At least 18.
    head_bytes
        Bytes of the head and the end together.
    circle_bytes
        Bytes of a circle.
    polygon_bytes
        Bytes of a polygon besides its corners.
    corner_bytes
        Bytes of a corner.
    max_corners
        Largest number of corners of a polygon: it is stored in one byte.
    max_growth
        Share of the clearance by which a simplified zone may reach beyond its obstacle, from 0 to
        less than 1: the path keeps the whole clearance, and a vehicle needs some of it.
    """

    max_bytes: int = 672
    head_bytes: int = 5
    circle_bytes: int = 13
    polygon_bytes: int = 2
    corner_bytes: int = 8
    max_corners: int = 255
    max_growth: float = 0.5

    def __post_init__(self) -> None:
        if not self.max_bytes >= self.head_bytes + self.circle_bytes:
            raise InputError(
                f"max_bytes: expected {self.head_bytes + self.circle_bytes} or more, got "
                f"{self.max_bytes!r}"
            )
        if not 0.0 <= self.max_growth < 1.0:
            raise InputError(f"max_growth: expected 0 to less than 1, got {self.max_growth!r}")

    def size(self, zones: Sequence[Zone]) -> int:
        """Return the bytes that a fence takes.

        Parameters
        ----------
        zones : sequence of Zone
            Zones of the fence.

        Returns
        -------
        int
            Bytes, with head and end.
        """
        return self.head_bytes + sum(self.size_of(z) for z in zones)

    def size_of(self, zone: Zone) -> int:
        """Return the bytes that a zone takes.

        Parameters
        ----------
        zone : Zone
            Zone of a fence.

        Returns
        -------
        int
            Bytes, without head and end.
        """
        if isinstance(zone.shape, Circle):
            return self.circle_bytes
        return self.polygon_bytes + self.corner_bytes * len(zone.shape.polygon)


@dataclass(frozen=True)
class Zone:
    """Exclusion zone of a fence.

    Attributes
    ----------
    obstacle
        Index of its obstacle in the problem.
    shape
        Circle or polygon that holds the obstacle.
    growth
        Upper bound on the distance by which the zone reaches beyond its obstacle, in the problem's
        units; 0 for the obstacle itself.
    """

    obstacle: int
    shape: Circle | Polygon
    growth: float = 0.0


@dataclass(frozen=True)
class Fence:
    """Fence of a plan.

    Attributes
    ----------
    zones
        Zones in the order of the problem's obstacles.
    left_out
        Indices of the obstacles without a zone.
    n_bytes
        Bytes that it takes in the vehicle.
    """

    zones: tuple[Zone, ...]
    left_out: tuple[int, ...]
    n_bytes: int

    @property
    def simplified(self) -> tuple[Zone, ...]:
        """Return the zones that reach beyond their obstacles."""
        return tuple(z for z in self.zones if z.growth > 0.0)


def fence_of(
    problem: Problem, path: Sequence[Point2] | Floats, policy: FencePolicy | None = None
) -> Fence:
    """Return the fence of the obstacles of a problem, small enough for the vehicle.

    Where the obstacles as they are take too many bytes, polygons are simplified: each becomes a
    polygon with fewer corners, or a circle, that holds it and reaches beyond it by a share of the
    clearance at most, and never touches the path. The share grows until the fence fits. What still
    is too much is left out, the obstacles farthest from the path first.

    Parameters
    ----------
    problem : Problem
        Problem with obstacles.
    path : sequence of (x, y)
        Straight lines of the tour, in the problem's units.
    policy : FencePolicy, optional
        Policy of what the fence may take.

    Returns
    -------
    Fence
        The zones, and the obstacles left out.

    Examples
    --------
    >>> site = Problem(base=(0, 0), goals=[(9, 0)], tether_length=20,
    ...                obstacles=[Circle(center=(x, 5), radius=0.1) for x in range(60)])
    >>> fence = fence_of(site, [(0, 0), (9, 0)])
    >>> len(fence.zones), fence.left_out[0], fence.n_bytes
    (51, 51, 668)
    """
    policy = policy or FencePolicy()
    line = shapely.LineString(np.asarray(path, dtype=float)[:, :2])
    zones = [Zone(k, o) for k, o in enumerate(problem.obstacles)]
    for step in range(1, GROWTH_STEPS + 1):
        if policy.size(zones) <= policy.max_bytes and not any(_is_large(z, policy) for z in zones):
            break
        most = policy.max_growth * problem.clearance * step / GROWTH_STEPS
        zones = [_simplified(z, problem.obstacles[z.obstacle], most, line, policy) for z in zones]
    far = {z.obstacle: problem.obstacles[z.obstacle].shape().distance(line) for z in zones}
    kept = [z for z in zones if not _is_large(z, policy)]
    for zone in sorted(kept, key=lambda z: (-far[z.obstacle], -z.obstacle)):
        if policy.size(kept) <= policy.max_bytes:
            break
        kept.remove(zone)
    held = {z.obstacle for z in kept}
    out = tuple(k for k in range(len(problem.obstacles)) if k not in held)
    return Fence(tuple(kept), out, policy.size(kept))


def _is_large(zone: Zone, policy: FencePolicy) -> bool:
    return isinstance(zone.shape, Polygon) and len(zone.shape.polygon) > policy.max_corners


def _simplified(
    zone: Zone, obstacle: Circle | Polygon, most: float, line: shapely.LineString,
    policy: FencePolicy,
) -> Zone:  # fmt: skip
    """Return the smallest zone found that holds an obstacle and reaches beyond it by a length at
    most."""
    if isinstance(obstacle, Circle) or most <= 0.0:
        return zone
    body = shapely.Polygon(obstacle.polygon)
    limit = body.buffer(most, quad_segs=QUARTER_SEGMENTS)
    best = zone
    for share in (0.0, 0.25, 0.5, 0.75):
        wide = body.buffer(share * most, join_style="mitre") if share else body
        for shape in (wide.simplify((1.0 - share) * most), wide.convex_hull.simplify(0.5 * most)):
            if shape.geom_type != "Polygon" or shape.interiors or len(shape.exterior.coords) < 4:
                continue
            if not (shape.covers(body) and limit.covers(shape) and shape.disjoint(line)):
                continue
            corners = tuple((float(x), float(y)) for x, y in shape.exterior.coords[:-1])
            tried = Zone(zone.obstacle, Polygon(polygon=corners), most)
            if policy.size_of(tried) < policy.size_of(best):
                best = tried
    circle = _circle_about(obstacle)
    outside = circle.radius / np.cos(np.pi / (4.0 * QUARTER_SEGMENTS))  # of a polygon around it
    disc = shapely.Point(circle.center).buffer(outside, quad_segs=QUARTER_SEGMENTS)
    round_zone = Zone(zone.obstacle, circle, most)
    if (
        limit.covers(disc)
        and disc.disjoint(line)
        and policy.size_of(round_zone) < policy.size_of(best)
    ):
        best = round_zone
    return best


def _circle_about(obstacle: Polygon) -> Circle:
    """Return the smallest circle that holds a polygon, larger by a rounding error."""
    corners = np.array(obstacle.polygon)
    middle = shapely.minimum_bounding_circle(shapely.MultiPoint(corners)).centroid
    radius = float(np.hypot(corners[:, 0] - middle.x, corners[:, 1] - middle.y).max())
    return Circle(center=(middle.x, middle.y), radius=radius * (1.0 + 1e-9))
