"""Short paths of a robot in exact solids, found and checked without netsp's planner.

A visibility graph over points off the surfaces, points in the open water and known passages gives
paths; they are pulled tight vertex by vertex. Each path is certified: spheres that hold no solid
cover it (`is_clear`). So its length is an upper bound on the distance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from solid_distances import Water, room_at, rooms_at

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.compiled.kernel import kernel

STEP = 1e-3
"""Tolerance of the certificate: shortest step along a path, metres."""


@kernel
def is_clear(water: Water, a: Floats, b: Floats, room: float) -> bool:
    """Return whether all points of a segment are as far from solids as `room`; certified, because
    the distance changes by at most a metre over a metre."""
    long = math.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2 + (b[2] - a[2]) ** 2)
    ux, uy, uz, at = 0.0, 0.0, 0.0, 0.0
    if long > 0.0:
        ux, uy, uz = (b[0] - a[0]) / long, (b[1] - a[1]) / long, (b[2] - a[2]) / long
    while True:
        d = room_at(water, a[0] + at * ux, a[1] + at * uy, a[2] + at * uz)
        if d < room + 0.5 * STEP:
            return False
        if at >= long:
            return True
        # between voxels the distance changes by up to twice the way
        at = min(long, at + max(STEP, (0.5 if water.by_field else 1.0) * (d - room)))


@kernel
def sights(water: Water, points: Floats, places: int, longest: float, room: float) -> Floats:
    """Return the distances (n, n) of points that see one another at `room`; infinite for others,
    and for points farther than `longest` from one another, except the first, which are places."""
    n = len(points)
    out = np.full((n, n), math.inf)
    for i in range(n):
        out[i, i] = 0.0
        for j in range(i):
            d = math.sqrt(
                (points[i, 0] - points[j, 0]) ** 2 + (points[i, 1] - points[j, 1]) ** 2
                + (points[i, 2] - points[j, 2]) ** 2
            )  # fmt: skip
            if (j < places or d <= longest) and is_clear(water, points[i], points[j], room):
                out[i, j] = out[j, i] = max(d, 1e-9)
    return out


@kernel
def tightened(water: Water, path: Floats, room: float, rounds: int) -> Floats:
    """Return a path (m, 3) with the same ends that is no longer.

    Vertices are left out, or moved towards the straight line between their neighbours, as long as
    both segments stay clear.
    """
    line = path.copy()
    for level in range(4):
        for _ in range(rounds):
            moved, i = 0.0, 1
            while i < len(line) - 1:
                a, p, b = line[i - 1], line[i], line[i + 1]
                if is_clear(water, a, b, room):
                    rest = np.empty((len(line) - 1, 3))
                    rest[:i] = line[:i]
                    rest[i:] = line[i + 1 :]
                    line = rest
                    moved = 1.0
                    continue
                size, t = 0.0, 0.0
                for k in range(3):
                    size += (b[k] - a[k]) ** 2
                    t += (p[k] - a[k]) * (b[k] - a[k])
                t = 0.5 if size == 0.0 else min(1.0, max(0.0, t / size))
                share = 1.0
                while share > 2e-3:
                    q = np.empty(3)
                    for k in range(3):
                        q[k] = p[k] + share * (a[k] + t * (b[k] - a[k]) - p[k])
                    if is_clear(water, a, q, room) and is_clear(water, q, b, room):
                        step = math.sqrt(
                            (q[0] - p[0]) ** 2 + (q[1] - p[1]) ** 2 + (q[2] - p[2]) ** 2
                        )
                        moved = max(moved, step)
                        line[i] = q
                        break
                    share *= 0.5
                i += 1
            if moved < 1e-5:
                break
        if level == 3 or len(line) == 2:
            break
        # add vertices near each corner
        near = (0.5, 0.2, 0.08)[level]
        more = np.empty((3 * len(line), 3))
        count = 1
        more[0] = line[0]
        for i in range(1, len(line)):
            a, b = line[i - 1], line[i]
            long = math.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2 + (b[2] - a[2]) ** 2)
            share = min(0.5, near / max(long, 1e-12))
            if i > 1 and share > 0.0:
                more[count] = a + share * (b - a)
                count += 1
            if i < len(line) - 1 and share < 0.5:
                more[count] = b + share * (a - b)
                count += 1
            more[count] = b
            count += 1
        line = more[:count].copy()
    return line


@dataclass
class Box:
    """Region of the paths.

    Attributes
    ----------
    low, high
        (3,) corners, metres.
    anchor, reach
        Anchor of the tether, and greatest distance from it, metres.
    """

    low: Floats
    high: Floats
    anchor: Floats
    reach: float

    def holds(self, points: Floats) -> Bools:
        """Return the mask of points (n, 3) in the region."""
        inside = ((points >= self.low) & (points <= self.high)).all(axis=1)
        near = np.linalg.norm(points - self.anchor, axis=1) <= self.reach
        return np.asarray(inside & near)


@dataclass
class FreePaths:
    """Paths between places that keep the room of each leg.

    Attributes
    ----------
    water, box
        Solids and region.
    places
        (v, 3) ends of the legs, metres.
    rooms
        (v, v) room of each leg, metres.
    hints
        (k, 3) places in known passages, metres.
    points
        Number of random points of each kind.
    longest
        Longest edge between two points that are no places, metres.
    """

    water: Water
    box: Box
    places: Floats
    rooms: Floats
    hints: Floats
    rng: np.random.Generator
    points: int = 150
    longest: float = 2.5
    paths: dict[tuple[int, int], list[Floats]] = field(default_factory=dict)

    def find(self, variants: int = 1) -> Floats:
        """Find paths between all places, and return the lengths (v, v) of the shortest; infinite
        where there is none.

        Parameters
        ----------
        variants : int
            Maximum number of paths between two places that differ in where they pass.
        """
        from scipy.sparse.csgraph import dijkstra

        v = len(self.places)
        lengths = np.full((v, v), np.inf)
        np.fill_diagonal(lengths, 0.0)
        for room in np.unique(self.rooms[np.triu_indices(v, 1)]):
            points = np.vstack([self.places, self._samples(float(room))])
            sight = sights(self.water, points, v, self.longest, float(room))
            far, before = dijkstra(
                np.where(np.isfinite(sight), sight, 0.0), indices=np.arange(v),
                return_predecessors=True, directed=False,
            )  # fmt: skip
            for i, j in np.argwhere(np.triu(self.rooms == room, 1)).tolist():
                self._keep((i, j), points, far, before, variants)
                if self.paths[i, j]:
                    lengths[i, j] = lengths[j, i] = length_of(self.paths[i, j][0])
        return lengths

    def _keep(
        self, ends: tuple[int, int], points: Floats, far: Floats, before: Ints, variants: int
    ) -> None:
        """Keep the shortest path between two places, and some that pass elsewhere."""
        i, j = ends
        found: list[Floats] = []
        total, room = far[i] + far[j], float(self.rooms[i, j])
        order = [j] if np.isfinite(far[i, j]) else []
        if variants > 1 and order:
            near = np.argsort(total)
            order += [int(m) for m in near[: 40 * variants : 20] if np.isfinite(total[m])]
            order += [int(m) for m in near[len(near) // 4 :: len(near) // 8][: 2 * variants]
                      if np.isfinite(total[m])]  # fmt: skip
        for m in order:
            back = _trace(before[j], j, m)[::-1][1:] if m != j else []
            path = [*_trace(before[i], i, m), *back]
            line = tightened(self.water, np.ascontiguousarray(points[path]), room, 30)
            if all(_differ(line, other) for other in found):
                found.append(line)
            if len(found) >= variants:
                break
        found.sort(key=length_of)
        self.paths[i, j] = found
        self.paths[j, i] = [np.ascontiguousarray(line[::-1]) for line in found]

    def _samples(self, room: float) -> Floats:
        """Return points with enough room: random ones, others off the surfaces, and hints."""
        box, rng, water = self.box, self.rng, self.water
        low = np.maximum(box.low, box.anchor - box.reach)
        high = np.minimum(box.high, box.anchor + box.reach)
        around = np.array([self.places.min(0) - 2.5, self.places.max(0) + 2.5])
        low, high = np.maximum(low, around[0]), np.minimum(high, around[1])
        free = rng.uniform(low, high, (self.points, 3))
        near = rng.uniform(low, high, (2 * self.points, 3))
        for _ in range(6):
            d, slope = rooms_at(water, near), np.empty_like(near)
            for k in range(3):
                step = np.zeros(3)
                step[k] = 1e-5
                slope[:, k] = (rooms_at(water, near + step) - rooms_at(water, near - step)) / 2e-5
            near = near + (room + 0.004 - d)[:, None] * slope
        points = np.vstack([self.hints.reshape(-1, 3), free, near])
        return points[box.holds(points) & (rooms_at(water, points) >= room + STEP)]


def length_of(path: Floats) -> float:
    """Return the length of a path (k, 3), metres."""
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


def keeps(water: Water, path: Floats, room: float) -> bool:
    """Return whether a path (k, 3) is certified to keep some room."""
    return all(is_clear(water, path[k], path[k + 1], room) for k in range(len(path) - 1))


def _trace(before: Ints, root: int, end: int) -> list[int]:
    """Return the vertices from a root to an end."""
    path = [end]
    while path[-1] != root:
        path.append(int(before[path[-1]]))
    return path[::-1]


def _differ(a: Floats, b: Floats, by: float = 0.1) -> bool:
    """Return whether two paths of the same ends are somewhere farther from one another."""
    shares = np.linspace(0.0, 1.0, 21)
    lines = []
    for line in (a, b):
        s = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))]
        lines.append(np.column_stack([np.interp(shares * s[-1], s, line[:, k]) for k in range(3)]))
    return bool(np.linalg.norm(lines[0] - lines[1], axis=1).max() > by)
