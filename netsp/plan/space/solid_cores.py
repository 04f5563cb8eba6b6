"""Cores of solids: straight segments deep inside of them, joined where solids overlap.

A path or tether that enters solids by less than a given depth stays away from all cores, and loops
of cores are what tethers wind around (docs/theory, Section 23).
"""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from netsp.base.arrays import Floats, Ints
from netsp.plan.space.cross_sections import solid_rows
from netsp.plan.space.mission_policy import ClassPolicy
from netsp.world.scene import solids
from netsp.world.scene.field import DistanceField
from netsp.world.scene.packing import ROW, ROWS
from netsp.world.scene.solids import solid_distance

MAX_SHIFT = 1e-4
"""Tolerance for nodes, metres: each is moved at random by up to this distance, so that straight
segments between waypoints of a symmetric scene do not meet cores."""

OVERLAP_TOLERANCE = 1.1 * MAX_SHIFT
"""Tolerance for joints: metres by which cores are deeper than they have to be."""

MERGE_DISTANCE = 1e-7
"""Tolerance for nodes, metres: nearer ones are the same node. Less than a tenth of `MAX_SHIFT`."""


@dataclass(frozen=True)
class Cores:
    """Graph of straight segments inside of solids.

    Attributes
    ----------
    points
        (n, 3) nodes, metres.
    edges
        (m, 2) nodes of each segment.
    depth
        (m,) no point of the segment is less deep in a solid, metres.
    """

    points: Floats
    edges: Ints
    depth: Floats

    def loops(self) -> Cores:
        """Return the segments that are part of a loop, or between two loops."""
        edges, kept = self.edges, np.ones(len(self.edges), dtype=np.bool_)
        while True:
            degree = np.bincount(edges[kept].ravel(), minlength=len(self.points))
            loose = kept & (degree[edges] == 1).any(1)
            if not loose.any():
                return Cores(self.points, edges[kept], self.depth[kept])
            kept &= ~loose


@dataclass(frozen=True)
class _Lines:
    """Core of one solid before it is joined.

    Attributes
    ----------
    begins, ends
        (k, 3) ends of its segments, metres.
    depth
        No point of the segments is less deep in the solid, metres.
    """

    begins: Floats
    ends: Floats
    depth: float


def solid_cores(field: DistanceField, dip: float, policy: ClassPolicy = ClassPolicy()) -> Cores:
    """Return the cores of a scene's bars, rings and of the solids that these are rooted in.

    Bars are capsules and cylinders. Half-spaces and boxes have no core of their own, but join all
    bars that end in them. Other solids are left out.

    Parameters
    ----------
    dip : float
        Depth to which paths and tethers may enter solids, metres; cores are deeper.
    policy : ClassPolicy
        Sizes of the cores.

    Returns
    -------
    Cores
        No cores if the scene has too many segments.

    Examples
    --------
    >>> from netsp.world import Scene
    >>> corners = [[0, 0, 0], [2, 0, 0], [1, 2, 0]]
    >>> bars = [{"a": corners[k - 1], "b": corners[k], "radius": 0.1} for k in range(3)]
    >>> cores = solid_cores(Scene(solids=[{"capsule": bar} for bar in bars]).field(), 0.01)
    >>> len(cores.loops().edges)
    3
    """
    offset, min_depth = float(field.arrays.offset), dip + OVERLAP_TOLERANCE
    lines: list[_Lines] = []
    hubs: list[int] = []
    for n, (kind, row) in enumerate(solid_rows(field)):
        core = _core(kind, row, offset, policy.sagitta_share)
        if core is not None and core.depth > min_depth:
            lines.append(core)
        elif kind in (solids.HALF_SPACE, solids.BOX):
            hubs.append(n)
    if not lines or sum(len(line.begins) for line in lines) > policy.max_segments:
        return Cores(np.zeros((0, 3)), np.zeros((0, 2), dtype=np.int64), np.zeros(0))
    graph = _Graph(lines)
    for one, other, p, q, gap in _contacts(graph, min_depth):
        graph.join(one, p, other, q, gap)
    for n in hubs:
        graph.join_in_hub(
            _deepest(graph, field.arrays.data, n, offset, min_depth, policy.hub_samples)
        )
    return graph.cores(policy)


def _core(kind: int, row: Floats, offset: float, sagitta_share: float) -> _Lines | None:
    """Return the core of a bar or ring; None for other solids."""
    if kind == solids.CAPSULE:
        return _Lines(row[None, :3].copy(), row[None, 3:6].copy(), float(row[6]) + offset)
    if kind == solids.CYLINDER:
        radius, length = float(row[6]), float(row[7])
        # points this far from both ends are as deep as those in the middle
        spare = min(radius, 0.5 * length)
        begin, end = row[:3] + spare * row[3:6], row[:3] + (length - spare) * row[3:6]
        return _Lines(begin[None], end[None], spare + offset)
    if kind == solids.TORUS:
        bend, radius, angle = float(row[9]), float(row[10]), float(row[11])
        half = math.acos(max(-1.0, 1.0 - sagitta_share * radius / bend))
        count = max(4, math.ceil(0.5 * angle / half))
        t = np.linspace(0.0, angle, count + 1)[:, None]
        side = np.cross(row[3:6], row[6:9])
        points = row[:3] + bend * (np.cos(t) * row[6:9] + np.sin(t) * side)
        if angle >= 2.0 * math.pi - 1e-12:
            points[-1] = points[0]
        sagitta = bend * (1.0 - math.cos(0.5 * angle / count))
        return _Lines(points[:-1], points[1:], radius + offset - sagitta)
    return None


class _Graph:
    """Segments of all solids, with the nodes that split them."""

    def __init__(self, lines: list[_Lines]) -> None:
        self.begins = np.vstack([line.begins for line in lines])
        self.ends = np.vstack([line.ends for line in lines])
        counts = [len(line.begins) for line in lines]
        self.solid: Ints = np.repeat(np.arange(len(lines)), counts)
        self.depth: Floats = np.repeat([line.depth for line in lines], counts)
        self.nodes: list[Floats] = []
        self.joints: list[tuple[int, int, float]] = []
        self._splits: list[list[tuple[float, int]]] = []
        for a, b in zip(self.begins, self.ends, strict=True):
            self._splits.append([(0.0, self._node(a)), (1.0, self._node(b))])

    def _node(self, point: Floats) -> int:
        """Add a node, and return its number."""
        self.nodes.append(point)
        return len(self.nodes) - 1

    def point(self, segment: int, t: float) -> Floats:
        """Return the point (3,) of a segment at a share of its length, metres."""
        return np.asarray(self.begins[segment] + t * (self.ends[segment] - self.begins[segment]))

    def _split(self, segment: int, t: float) -> int:
        """Add a node on a segment, and return its number."""
        node = self._node(self.point(segment, t))
        self._splits[segment].append((t, node))
        return node

    def join(self, one: int, p: float, other: int, q: float, gap: float) -> None:
        """Join two segments of solids that overlap, at shares of their lengths."""
        depth = 0.5 * (self.depth[one] + self.depth[other] - gap)
        self.joints.append((self._split(one, p), self._split(other, q), float(depth)))

    def join_in_hub(self, contacts: list[tuple[int, float, float]]) -> None:
        """Join segments inside of a convex solid; contacts are segment, share and depth."""
        nodes = [(self._split(segment, t), depth) for segment, t, depth in contacts]
        for node, depth in nodes[1:]:
            self.joints.append((nodes[0][0], node, min(nodes[0][1], depth)))

    def cores(self, policy: ClassPolicy) -> Cores:
        """Return the graph whose segments end at nodes; nodes at the same point are one."""
        points = np.array(self.nodes)
        number = _merged(points)
        kept: dict[tuple[int, int], float] = {}

        def keep(a: int, b: int, depth: float) -> tuple[int, int] | None:
            u, v = sorted((int(number[a]), int(number[b])))
            if u == v or (u, v) in kept:
                return None
            kept[u, v] = depth
            return u, v

        for depth, splits in zip(self.depth, self._splits, strict=True):
            for (_, a), (_, b) in pairwise(sorted(splits)):
                keep(a, b, float(depth))
        for a, b, depth in self.joints:
            joint = keep(a, b, depth)
            longest = policy.min_loop_depths * depth
            if joint is not None and _is_tiny_loop(points, kept, joint, longest):
                del kept[joint]
        shifts = np.random.default_rng(policy.seed).uniform(-0.5, 0.5, points.shape) * MAX_SHIFT
        edges = np.array(list(kept), dtype=np.int64).reshape(-1, 2)
        return Cores(points + shifts, edges, np.array([*kept.values()]) - MAX_SHIFT)


def _is_tiny_loop(
    points: Floats, edges: dict[tuple[int, int], float], joint: tuple[int, int], max_length: float
) -> bool:
    """Return whether a joint closes a loop that is no longer than a length, metres."""
    lengths = {e: float(np.linalg.norm(points[e[0]] - points[e[1]])) for e in edges}
    neighbours: dict[int, list[tuple[int, float]]] = {}
    for (u, v), length in lengths.items():
        if (u, v) != joint:
            neighbours.setdefault(u, []).append((v, length))
            neighbours.setdefault(v, []).append((u, length))
    spare = max_length - lengths[joint]
    far, queue = {joint[0]: 0.0}, [(0.0, joint[0])]
    while queue:
        d, u = heapq.heappop(queue)
        if u == joint[1]:
            return True
        for v, length in neighbours.get(u, []):
            if d + length <= spare and d + length < far.get(v, math.inf):
                far[v] = d + length
                heapq.heappush(queue, (d + length, v))
    return False


def _merged(points: Floats) -> Ints:
    """Return for each point the number of the first one that is closer than the tolerance."""
    number = np.arange(len(points))
    for k in range(len(points)):
        if number[k] == k:
            near = np.linalg.norm(points[k + 1 :] - points[k], axis=1) <= MERGE_DISTANCE
            later = k + 1 + np.flatnonzero(near)
            number[later[number[later] == later]] = k
    return number


def _contacts(graph: _Graph, min_depth: float) -> list[tuple[int, int, float, float, float]]:
    """Return where solids overlap: two segments, the shares of their lengths at their closest
    points, and the distance of these, metres. There is one contact for each place."""
    n = len(graph.begins)
    one, other = np.triu_indices(n, 1)
    differs = graph.solid[one] != graph.solid[other]
    one, other = one[differs], other[differs]
    p, q, gap = closest_points(
        graph.begins[one], graph.ends[one], graph.begins[other], graph.ends[other]
    )
    overlap = graph.depth[one] + graph.depth[other] - gap
    out: list[tuple[int, int, float, float, float]] = []
    found: dict[tuple[int, int], list[Floats]] = {}
    for k in np.lexsort((other, one, gap)):
        if overlap[k] <= 2.0 * min_depth:
            continue
        i, j = int(one[k]), int(other[k])
        at = graph.point(i, float(p[k]))
        before = found.setdefault((int(graph.solid[i]), int(graph.solid[j])), [])
        # two joints this near to one another enclose no passage
        apart = 2.0 * (graph.depth[i] + graph.depth[j])
        if all(np.linalg.norm(at - other_at) > apart for other_at in before):
            before.append(at)
            out.append((i, j, float(p[k]), float(q[k]), float(gap[k])))
    return out


def closest_points(a: Floats, b: Floats, c: Floats, d: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the closest points of segments ab and cd, and their distance.

    Parameters
    ----------
    a, b, c, d : ndarray of shape (k, 3)
        Ends of the segments, metres.

    Returns
    -------
    p, q : ndarray of shape (k,)
        Shares of the lengths of ab and cd, from 0 to 1.
    gap : ndarray of shape (k,)
        Distance of these two points, metres; for parallel segments it may be longer than the least
        distance by rounding only.
    """
    u, v, w = b - a, d - c, a - c
    uu, vv, uv = (u * u).sum(1), (v * v).sum(1), (u * v).sum(1)
    uw, vw = (u * w).sum(1), (v * w).sum(1)
    with np.errstate(divide="ignore", invalid="ignore"):
        det = uu * vv - uv * uv
        inner = np.where(det > 1e-12 * uu * vv, (uv * vw - vv * uw) / det, 0.0)
        found = []
        # the pair of closest points is inside of both, or an end of one and its closest point
        for start in (np.clip(inner, 0.0, 1.0), np.zeros(len(a)), np.ones(len(a))):
            q = np.clip(np.where(vv > 0.0, (uv * start + vw) / vv, 0.0), 0.0, 1.0)
            p = np.clip(np.where(uu > 0.0, (uv * q - uw) / uu, 0.0), 0.0, 1.0)
            gap = np.linalg.norm(w + p[:, None] * u - q[:, None] * v, axis=1)
            found.append(np.stack([p, q, gap]))
    every = np.stack(found)
    p, q, gap = every[every[:, 2].argmin(0), :, np.arange(len(a))].T
    return p, q, gap


def _deepest(
    graph: _Graph, data: Floats, hub: int, offset: float, min_depth: float, samples: int
) -> list[tuple[int, float, float]]:
    """Return for each bar that ends in a box or half-space a segment, the share of its length
    where it is deepest there, and that depth, metres."""
    best: dict[int, tuple[int, float, float]] = {}
    for segment in range(len(graph.begins)):
        for t in np.linspace(0.0, 1.0, samples):
            x, y, z = graph.point(segment, float(t))
            depth = offset - solid_distance(data, ROWS + ROW * hub, x, y, z)[0]
            solid = int(graph.solid[segment])
            if depth > max(min_depth, best.get(solid, (0, 0.0, -math.inf))[2]):
                best[solid] = (segment, float(t), float(depth))
    return list(best.values())
