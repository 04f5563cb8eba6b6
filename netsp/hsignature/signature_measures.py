"""Measures of the entanglement of a path, by the definitions of the literature.

Of the path as a loop, which starts and ends at the base:

- *empty signature*: the reduced word is empty, so the tether can be pulled back to the base
(McCammon &
  Hollinger 2017, section III).
- *entangled obstacles*: those of the cyclically reduced word (`netsp.hsignature.entangled`).
- *winding numbers*: turns around each obstacle, counter-clockwise positive. They say less than the
  word: a path may have winding number 0 around each obstacle and still be entangled.
- *self-crossings*: number of times that the path crosses itself in plan.

Of the path as a tether from the anchor, its first point, to the robot (Battocletti, Boskos, Tolić,
Palunko & De Schutter 2024, "Entanglement definitions for tethered robots: exploration and
analysis", IEEE Access; touching an obstacle is not entanglement):

- *obstacle-free convex hull*: the convex hull of the tether meets the interior of no obstacle.
- *obstacle-free linear homotopy*: each point of the tether moves straight to the anchor, H(s, t) =
  (1 - t) γ(s) + t γ(0), and the tether sweeps the interior of no obstacle.
- *local visibility homotopy*: whenever two points of the tether see each other, the tether between
  them is homotopic to the straight line between them.

The result for each definition is the set of obstacles that break it. If none breaks the convex
hull, none breaks the other two.
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
from netsp.hsignature.signature_policy import MeasurePolicy
from netsp.hsignature.words import Word, entangled, reduce
from netsp.model.problem import Problem


@dataclass(frozen=True)
class Measures:
    """Measures of one path; obstacles are numbered from 0.

    Attributes
    ----------
    signature
        Reduced word.
    closed
        Whether the path ends where it starts. If not, `entangled` and `winding` are None.
    convex_hull, linear_homotopy, local_visibility
        Obstacles that break the definition.
    """

    signature: Word
    closed: bool
    entangled: tuple[int, ...] | None
    winding: tuple[int, ...] | None
    self_crossings: int
    convex_hull: tuple[int, ...]
    linear_homotopy: tuple[int, ...]
    local_visibility: tuple[int, ...]


def measure(
    problem: Problem, path: npt.ArrayLike, policy: MeasurePolicy = MeasurePolicy()
) -> Measures:
    """Return the measures of a polyline (k, 2) or (k, 3), in plan, among the obstacles of a
    problem.

    Examples
    --------
    >>> from netsp import Circle, Problem
    >>> problem = Problem(base=(0, 0), goals=[(4, 0)], tether_length=9,
    ...                   obstacles=[Circle(center=(2, 0), radius=1)])
    >>> measures = measure(problem, [(0, 0), (2, 2), (4, 0), (2, -2), (0, 0)])
    >>> measures.entangled, measures.winding
    ((0,), (-1,))
    """
    xy = np.asarray(path, dtype=float)[:, :2]
    rays = problem.representative_points
    slack = policy.contact_depth * problem.scale
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
        self_crossings=self_crossings(xy, tolerance=max(slack, policy.sagitta * largest)),
        convex_hull=in_convex_hull(xy, shapes),
        linear_homotopy=in_linear_homotopy(xy, shapes),
        local_visibility=against_local_visibility(xy, shapes, rays, policy),
    )


def winding_numbers(path: Floats, points: Floats) -> Floats:
    """Return the turns (n,) of a polyline around each point, counter-clockwise positive.

    Turns of a closed path are whole numbers.
    """
    if len(points) == 0:
        return np.zeros(0)
    arm = path[:, None, :] - points[None, :, :]
    angle = np.arctan2(arm[..., 1], arm[..., 0])
    turn = np.diff(angle, axis=0)
    turn -= 2.0 * np.pi * np.round(turn / (2.0 * np.pi))
    return np.asarray(turn.sum(axis=0) / (2.0 * np.pi))


def self_crossings(path: Floats, *, tolerance: float = 0.0) -> int:
    """Return the number of times that a polyline crosses itself in plan.

    A vertex within `tolerance` of the line of an earlier segment is on neither side of it. The path
    crosses the segment if it comes from one side and leaves on the other. So a crossing at a vertex
    counts once, and a path that touches or retraces itself does not cross itself.
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
                # through the vertex between two segments: does it come and leave on different
                # sides?
                arms = p[[k - 1, k + 1, k + 1 + i, k + 1 + j]] - p[k]
                turn = np.mod(np.arctan2(arms[:, 1], arms[:, 0]), 2.0 * np.pi)
                turn = np.mod(turn - turn[0], 2.0 * np.pi)
                count += bool((turn[2] < turn[1]) != (turn[3] < turn[1]))
    return count


def in_convex_hull(path: Floats, shapes: Sequence[shapely.Geometry]) -> tuple[int, ...]:
    """Return the obstacles whose interior meets the convex hull of a path."""
    return _met([shapely.MultiPoint(path).convex_hull], shapes)


def in_linear_homotopy(path: Floats, shapes: Sequence[shapely.Geometry]) -> tuple[int, ...]:
    """Return the obstacles whose interior a path sweeps as it shrinks straight to its first point.

    An obstacle is swept if it meets the triangle of the first point and some segment.
    """
    triangles = [shapely.MultiPoint([path[0], a, b]).convex_hull for a, b in pairwise(path[1:])]
    return _met([shapely.LineString(path), *triangles], shapes)


def against_local_visibility(
    path: Floats,
    shapes: Sequence[shapely.Geometry],
    rays: Floats,
    policy: MeasurePolicy = MeasurePolicy(),
) -> tuple[int, ...]:
    """Return the obstacles between a tether and a free line of sight that joins two of its points.

    Lines of sight are tried between vertices and evenly spaced points of the tether.
    """
    if len(shapes) == 0 or len(path) < 3:
        return ()
    s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
    samples = np.union1d(s, np.linspace(0.0, s[-1], policy.visibility_points))
    line = np.column_stack([np.interp(samples, s, path[:, k]) for k in range(2)])
    first, second = np.triu_indices(len(line), 2)
    sight = shapely.linestrings(np.stack([line[first], line[second]], axis=1))
    solid = shapely.union_all(list(shapes))
    shapely.prepare(solid)
    free = ~shapely.intersects(solid, sight)
    # the letters between any two points are a slice of `letters`
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
    """Return the mask (k,) of segments from p to q (k, 2) that cross a ray."""
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
