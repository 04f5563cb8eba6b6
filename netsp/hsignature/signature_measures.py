"""How entangled is a path? The definitions in use, each for any path among the obstacles.

Of the path as a loop (closed by its ends being the base):

- *empty signature*: its reduced word is empty, so it can be pulled back to the base (McCammon &
  Hollinger 2017, section III).
- *entangled obstacles*: those of the cyclically reduced word (`netsp.hsignature.entangled`).
- *winding numbers*: how often it runs around each obstacle, counter-clockwise positive. Weaker than
  the word: a path may wind nowhere and still be entangled.
- *self-crossings*: how often it crosses itself in plan.

Of the path as a tether from its first point, the anchor, to its last, the robot; Battocletti,
Boskos, Tolić, Palunko & De Schutter 2024, "Entanglement definitions for tethered robots:
exploration and analysis", IEEE Access. A tether that merely touches an obstacle is not entangled by
it.

- *obstacle-free convex hull*: the convex hull of the tether meets the interior of no obstacle.
- *obstacle-free linear homotopy*: drawn straight to the anchor, H(s, t) = (1 - t) γ(s) + t γ(0),
  the tether sweeps the interior of no obstacle.
- *local visibility homotopy*: whenever two points of the tether see each other, the tether between
  them is homotopic to the straight line between them.

Each holds or fails; what fails names the obstacles in the way. The first implies the other two.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import shapely

from netsp.base.arrays import Bools, Floats
from netsp.hsignature.rays import crossings
from netsp.hsignature.words import Word, entangled, reduce
from netsp.model.problem import Problem

TOUCHING = 1e-6
"""How deep, relative to the size of the problem, a tether may reach into an obstacle it touches."""

SAGITTA = 1e-3
"""How far, as a share of the largest obstacle, two drawings of one arc may lie apart: drawn with
chords, a path that retraces an arc would seem to cross itself."""

VISIBILITY_POINTS = 120
"""Points of a tether between which lines of sight are tried, besides its vertices."""


@dataclass(frozen=True)
class Measures:
    """Of one path; obstacles by their 0-based index.

    Attributes
    ----------
    signature
        Reduced word.
    closed
        Whether the path ends where it starts; entangled and winding are None if not.
    convex_hull, linear_homotopy, local_visibility
        Obstacles that break the definition of that name; none if it holds.
    """

    signature: Word
    closed: bool
    entangled: tuple[int, ...] | None
    winding: tuple[int, ...] | None
    self_crossings: int
    convex_hull: tuple[int, ...]
    linear_homotopy: tuple[int, ...]
    local_visibility: tuple[int, ...]


def measure(problem: Problem, path: npt.ArrayLike) -> Measures:
    """All measures of a (k, 2) or (k, 3) polyline among a problem's obstacles; z does not count."""
    xy = np.asarray(path, dtype=float)[:, :2]
    rays = problem.representative_points
    slack = TOUCHING * problem.scale
    shapes = [o.shape(problem.clearance).buffer(-slack, quad_segs=32) for o in problem.obstacles]
    widths = [max(s.bounds[2] - s.bounds[0], s.bounds[3] - s.bounds[1]) for s in shapes if s]
    largest = max(widths, default=0.0)
    word = reduce(crossings(xy, rays))
    closed = bool(np.hypot(*(xy[0] - xy[-1])) <= slack)
    turns = winding_numbers(xy, rays)
    return Measures(
        signature=word,
        closed=closed,
        entangled=tuple(k - 1 for k in entangled(word)) if closed else None,
        winding=tuple(round(t) for t in turns.tolist()) if closed else None,
        self_crossings=self_crossings(xy, tolerance=max(slack, SAGITTA * largest)),
        convex_hull=in_convex_hull(xy, shapes),
        linear_homotopy=in_linear_homotopy(xy, shapes),
        local_visibility=against_local_visibility(xy, shapes, rays),
    )


def winding_numbers(path: Floats, points: Floats) -> Floats:
    """(n,) turns of a polyline around each point, counter-clockwise positive; whole numbers if the
    path is closed."""
    if len(points) == 0:
        return np.zeros(0)
    arm = path[:, None, :] - points[None, :, :]
    angle = np.arctan2(arm[..., 1], arm[..., 0])
    turn = np.diff(angle, axis=0)
    turn -= 2.0 * np.pi * np.round(turn / (2.0 * np.pi))
    return np.asarray(turn.sum(axis=0) / (2.0 * np.pi))


def self_crossings(path: Floats, *, tolerance: float = 0.0) -> int:
    """How often a polyline crosses itself in plan.

    A later vertex within `tolerance` of a segment's line is on neither side of it: the path crosses
    where it comes from one side and leaves on the other, so a path through a vertex of its own is
    counted once, and one that touches itself or retraces its steps is not.
    """
    step = np.hypot(*np.diff(path, axis=0).T)
    p = path[np.concatenate([[True], step > max(tolerance, 1e-150)])]
    count = 0
    for k in range(len(p) - 2):
        d = p[k + 1] - p[k]
        size = float(np.hypot(*d))
        arm = p[k + 1 :] - p[k]
        height = (d[0] * arm[:, 1] - d[1] * arm[:, 0]) / size
        along = (arm @ d) / (size * size)
        off = np.flatnonzero(np.abs(height) > tolerance)
        for i, j in pairwise(off.tolist()):
            if (height[i] > 0.0) == (height[j] > 0.0):
                continue
            if j == i + 1:
                t = along[i] + (along[j] - along[i]) * height[i] / (height[i] - height[j])
            else:
                t = along[j - 1]
            near = max(tolerance / size, 1e-12)
            if near < t < 1.0 - near:
                count += 1
            elif abs(t) <= near and k > 0:
                # through the vertex between two segments: in on one side of them, out on the other
                arms = p[[k - 1, k + 1, k + 1 + i, k + 1 + j]] - p[k]
                turn = np.mod(np.arctan2(arms[:, 1], arms[:, 0]), 2.0 * np.pi)
                turn = np.mod(turn - turn[0], 2.0 * np.pi)
                count += bool((turn[2] < turn[1]) != (turn[3] < turn[1]))
    return count


def in_convex_hull(path: Floats, shapes: Sequence[shapely.Geometry]) -> tuple[int, ...]:
    """Obstacles whose interior the convex hull of a path meets."""
    return _met([shapely.MultiPoint(path).convex_hull], shapes)


def in_linear_homotopy(path: Floats, shapes: Sequence[shapely.Geometry]) -> tuple[int, ...]:
    """Obstacles whose interior a path sweeps when it is drawn straight to its first point: those
    that meet a triangle of the first point and a segment."""
    triangles = [shapely.MultiPoint([path[0], a, b]).convex_hull for a, b in pairwise(path[1:])]
    return _met([shapely.LineString(path), *triangles], shapes)


def against_local_visibility(
    path: Floats, shapes: Sequence[shapely.Geometry], rays: Floats
) -> tuple[int, ...]:
    """Obstacles between a tether and a free line of sight of its own.

    Lines of sight are tried between all vertices and `VISIBILITY_POINTS` points spread evenly.
    """
    if len(shapes) == 0 or len(path) < 3:
        return ()
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
    spots = np.union1d(along, np.linspace(0.0, along[-1], VISIBILITY_POINTS))
    line = np.column_stack([np.interp(spots, along, path[:, k]) for k in range(2)])
    first, second = np.triu_indices(len(line), 2)
    sight = shapely.linestrings(np.stack([line[first], line[second]], axis=1))
    solid = shapely.union_all(list(shapes))
    shapely.prepare(solid)
    free = ~shapely.intersects(solid, sight)
    # the letters of the tether up to every spot; a sub-path's word needs no second look at it
    steps = [crossings(line[k : k + 2], rays) for k in range(len(line) - 1)]
    begin = np.concatenate([[0], np.cumsum([len(s) for s in steps])])
    letters = [x for s in steps for x in s]
    first, second = first[free], second[free]
    words: set[Word] = set()
    for a, b, crosses in zip(
        first, second, _cross_rays(line[first], line[second], rays), strict=True
    ):
        direct = crossings(line[[a, b]], rays) if crosses else ()
        words.add((*letters[begin[a] : begin[b]], *(-x for x in reversed(direct))))
    broken = {k for word in words for k in entangled(word)}
    return tuple(sorted(k - 1 for k in broken))


def _cross_rays(p: Floats, q: Floats, rays: Floats) -> Bools:
    """Return for segments from p to q, both (k, 2), whether they have letters (`crossings`)."""
    sides = (p[:, :1] >= rays[:, 0]) != (q[:, :1] >= rays[:, 0])
    (x, y), d = rays.T, q - p
    with np.errstate(divide="ignore", invalid="ignore"):
        height = p[:, 1:] + (x - p[:, :1]) / d[:, :1] * d[:, 1:]
    return np.asarray((sides & (height > y)).any(axis=1))


def _met(
    regions: Sequence[shapely.Geometry], shapes: Sequence[shapely.Geometry]
) -> tuple[int, ...]:
    every = np.array(regions, dtype=object)
    return tuple(k for k, s in enumerate(shapes) if shapely.intersects(every, s).any())
