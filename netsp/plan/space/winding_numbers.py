"""Winding numbers of paths around loops of cores.

Each loop of the cores (`netsp.plan.space.solid_cores`) is spanned by a cone of triangles. The
number of times that a path crosses the cone, with signs, changes only by what the path winds around
the loop: closed paths that can be deformed into one another have the same number. So these numbers
are a homomorphism of the homotopy classes, and a class whose number is not zero is not contractible
(docs/theory, Section 23).
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass

import numpy as np

from netsp.base.arrays import Floats, Ints
from netsp.plan.space.mission_policy import ClassPolicy
from netsp.plan.space.solid_cores import Cores

MIN_SIDE = 1e-10
"""Tolerance of crossings: least share of its factors' product that a determinant must have, so that
its sign is certain. A cone with an uncertain sign gets another tip."""


@dataclass(frozen=True)
class Loops:
    """Independent loops of cores.

    Attributes
    ----------
    cores
        Segments of the loops.
    incidence
        (m, k) how often and in which direction each loop runs along each segment: 1, -1 or 0.
    """

    cores: Cores
    incidence: Ints

    @classmethod
    def of_cores(cls, cores: Cores) -> Loops:
        """Return a basis of the loops of some cores: one for each segment that is not in a tree of
        shortest paths.

        Examples
        --------
        >>> import numpy as np
        >>> square = Cores(np.eye(4, 3), np.array([[0, 1], [1, 2], [2, 3], [3, 0]]), np.ones(4))
        >>> Loops.of_cores(square).incidence.shape
        (4, 1)
        """
        edges, n = cores.edges, len(cores.points)
        lengths = np.linalg.norm(np.diff(cores.points[edges], axis=1)[:, 0], axis=1)
        parent, order = _forest(n, edges, lengths)
        in_tree = np.zeros(len(edges), dtype=np.bool_)
        in_tree[[e for e in parent if e >= 0]] = True
        chords = np.flatnonzero(~in_tree)
        incidence = np.zeros((len(edges), len(chords)), dtype=np.int64)
        depth = {v: k for k, v in enumerate(order)}
        for loop, chord in enumerate(chords):
            incidence[chord, loop] = 1
            u, v = (int(x) for x in edges[chord])
            # back from v to u along the tree; the later node of the search steps to its parent
            while u != v:
                from_end = depth[v] > depth[u]
                node = v if from_end else u
                edge = parent[node]
                a, b = (int(x) for x in edges[edge])
                above = b if node == a else a
                along = (node, above) if from_end else (above, node)
                incidence[edge, loop] += 1 if along == (a, b) else -1
                if from_end:
                    v = above
                else:
                    u = above
        return cls(cores, incidence)

    def polygon(self, loop: int) -> tuple[Floats, Floats]:
        """Return the begins and ends (k, 3) of the segments of a loop, each in its direction."""
        along = np.flatnonzero(self.incidence[:, loop])
        pairs = self.cores.edges[along]
        backward = self.incidence[along, loop] < 0
        pairs[backward] = pairs[backward, ::-1]
        return self.cores.points[pairs[:, 0]], self.cores.points[pairs[:, 1]]


def _forest(n: int, edges: Ints, lengths: Floats) -> tuple[list[int], list[int]]:
    """Return a forest of shortest paths: the segment of each node to its parent, -1 at roots, and
    the nodes in the order of the search."""
    neighbours: list[list[tuple[int, int]]] = [[] for _ in range(n)]
    for e, (u, v) in enumerate(edges.tolist()):
        neighbours[u].append((v, e))
        neighbours[v].append((u, e))
    parent, order, done = [-1] * n, list[int](), [False] * n
    for root in range(n):
        queue = [] if done[root] or not neighbours[root] else [(0.0, root, -1)]
        while queue:
            d, u, e = heapq.heappop(queue)
            if done[u]:
                continue
            done[u], parent[u] = True, e
            order.append(u)
            for v, along in neighbours[u]:
                if not done[v]:
                    heapq.heappush(queue, (d + float(lengths[along]), v, along))
    return parent, order


class Crossings:
    """Numbers of crossings of straight segments between some points with the cones of loops.

    Parameters
    ----------
    loops : Loops
        The loops.
    points : ndarray of shape (n, 3)
        Ends of the segments, metres.
    pairs : ndarray of int, shape (p, 2)
        Ends of each segment, as in `points`.
    policy : ClassPolicy
        Number and seed of the tips tried for each cone.

    Attributes
    ----------
    used
        Numbers of the loops whose crossings are certain.
    counts
        (p, len(used)) number of crossings of each segment, with signs.
    """

    def __init__(self, loops: Loops, points: Floats, pairs: Ints, policy: ClassPolicy) -> None:
        rng = np.random.default_rng(policy.seed)
        used, counts = [], []
        for loop in range(loops.incidence.shape[1]):
            begins, ends = loops.polygon(loop)
            centre, size = begins.mean(0), float(np.ptp(begins, axis=0).max())
            for _ in range(policy.max_tips):
                tip = centre + 0.2 * size * rng.uniform(-1.0, 1.0, 3)
                crossed = _crossings(begins, ends, tip, points, pairs)
                if crossed is not None:
                    count = np.zeros(len(pairs), dtype=np.int64)
                    np.add.at(count, crossed[0], crossed[2])
                    used.append(loop)
                    counts.append(count)
                    break
        self.used: Ints = np.array(used, dtype=np.int64)
        self.counts: Ints = np.array(counts, dtype=np.int64).reshape(len(used), len(pairs)).T


def _crossings(
    begins: Floats, ends: Floats, tip: Floats, points: Floats, pairs: Ints
) -> tuple[Ints, Ints, Ints] | None:
    """Return the segments that cross triangles of a cone, the triangles, and the signs (k,) of the
    crossings; None if these are uncertain."""
    c, d, p = begins - tip, ends - tip, points - tip
    normal, sizes = np.cross(c, d), np.linalg.norm(p, axis=1)
    side = p @ normal.T
    size_c, size_d = np.linalg.norm(c, axis=1), np.linalg.norm(d, axis=1)
    if (np.abs(side) <= MIN_SIDE * sizes[:, None] * (size_c * size_d)).any():
        return None
    segment, triangle = np.nonzero((side[pairs[:, 0]] > 0.0) != (side[pairs[:, 1]] > 0.0))
    begin, end = pairs[segment, 0], pairs[segment, 1]
    c, d, a, b = c[triangle], d[triangle], p[begin], p[end]
    moment = np.cross(a, b)
    # sides on which the line passes the edges of the triangle (Plücker)
    past_c, past_d = (moment * c).sum(1), -(moment * d).sum(1)
    past_cd = (moment * (d - c)).sum(1) + ((b - a) * normal[triangle]).sum(1)
    rising = side[end, triangle] > 0.0
    uncertain = MIN_SIDE * sizes[begin] * sizes[end] * (size_c + size_d)[triangle]
    past = np.column_stack([past_c, past_d, past_cd])
    sure_out = ((past > uncertain[:, None]) != rising[:, None]) & (
        np.abs(past) > uncertain[:, None]
    )
    is_sure = (np.abs(past) > uncertain[:, None]).all(1) | sure_out.any(1)
    if not is_sure.all():
        return None
    inside = ((past > 0.0) == rising[:, None]).all(1)
    return segment[inside], triangle[inside], np.where(rising[inside], 1, -1)


def piercings(cores: Cores, points: Floats, pairs: Ints, policy: ClassPolicy) -> Ints | None:
    """Return how often each core pierces the triangles from straight segments to a common tip.

    For a closed path, the sum over its segments and over the cores of a loop, in their directions,
    is the winding number around the loop.

    Parameters
    ----------
    cores : Cores
        The cores.
    points : ndarray of shape (n, 3)
        Ends of the segments, metres.
    pairs : ndarray of int, shape (p, 2)
        Ends of each segment, as in `points`.
    policy : ClassPolicy
        Number and seed of the tips tried.

    Returns
    -------
    ndarray of int, shape (p, m), or None
        Numbers with signs; None if no tip gives certain ones.
    """
    rng, size = np.random.default_rng(policy.seed), float(np.ptp(points, axis=0).max())
    a, b = points[pairs[:, 0]], points[pairs[:, 1]]
    long = np.flatnonzero((a != b).any(1))
    for _ in range(policy.max_tips):
        tip = points.mean(0) + size * rng.uniform(-0.5, 0.5, 3)
        crossed = _crossings(a[long], b[long], tip, cores.points, cores.edges)
        if crossed is not None:
            counts = np.zeros((len(pairs), len(cores.edges)), dtype=np.int64)
            np.add.at(counts, (long[crossed[1]], crossed[0]), crossed[2])
            return counts
    return None


def costliest_loop(cores: Cores, pierced: Ints, costs: Floats) -> tuple[Ints, float] | None:
    """Return a loop that a closed path winds around, and what it costs to unwind the path.

    Parameters
    ----------
    cores : Cores
        The cores.
    pierced : ndarray of int, shape (m,)
        How often each core pierces a surface within the path.
    costs : ndarray of shape (m,)
        Cost of leading the path over each core.

    Returns
    -------
    (ndarray of int of shape (m,), float) or None
        How often the loop runs along each core, with signs, and the least cost of a core of the
        loop. No loop that the path winds around has a greater one. None if there is no such loop.
    """
    parent = list(range(len(cores.points)))
    height = [0] * len(parent)
    tree: dict[int, list[tuple[int, int, int]]] = {}

    def root(node: int) -> tuple[int, int]:
        total = 0
        while parent[node] != node:
            total += height[node]
            node = parent[node]
        return node, total

    for e in np.argsort(-costs, kind="stable").tolist():
        a, b = (int(x) for x in cores.edges[e])
        (root_a, to_a), (root_b, to_b) = root(a), root(b)
        # a potential that rises by the piercings along each core exists unless some loop has any
        if root_a != root_b:
            parent[root_b], height[root_b] = root_a, to_a + int(pierced[e]) - to_b
            tree.setdefault(a, []).append((b, e, 1))
            tree.setdefault(b, []).append((a, e, -1))
        elif to_b - to_a != pierced[e]:
            loop = np.zeros(len(cores.edges), dtype=np.int64)
            loop[e] = 1
            for along, sign in _tree_path(tree, b, a):
                loop[along] = sign
            return loop, float(costs[e])
    return None


def _tree_path(
    tree: dict[int, list[tuple[int, int, int]]], begin: int, end: int
) -> list[tuple[int, int]]:
    """Return the cores of the path between two nodes of a tree, each with its direction."""
    came: dict[int, tuple[int, int, int] | None] = {begin: None}
    stack = [begin]
    while end not in came:
        node = stack.pop()
        for other, edge, sign in tree.get(node, []):
            if other not in came:
                came[other] = node, edge, sign
                stack.append(other)
    out, step = [], came[end]
    while step is not None:
        node, edge, sign = step
        out.append((edge, sign))
        step = came[node]
    return out
