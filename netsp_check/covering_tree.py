"""Universal cover of a triangulation as a tree, and the places that a tether reaches in it.

Every path from the base crosses triangles; without detours back and forth these are a path in the
tree, whose nodes are the triangles of the universal cover (Lemma 5). A funnel holds the shortest
paths from one point to all points of an edge of a node.
"""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass

from netsp_check.problem_file import Refused
from netsp_check.triangulation import Point, Triangulation

LEFT, RIGHT = 0, 1
"""Index of the left and of the right side, in the sense of travel."""


class Funnel:
    """Shortest paths from a point through a sequence of gates.

    Attributes
    ----------
    passed : list of (point, side)
        Start, and the corners that all these paths turn at, up to the apex; the side is that of the
        gates whose end the corner is.
    distance : float
        Length of the path along `passed`.
    chains : pair of lists of points
        Corners from the apex, excluded, to the left and to the right end of the last gate.
    """

    __slots__ = ("chains", "distance", "passed")

    def __init__(self, start: Point) -> None:
        self.passed: list[tuple[Point, int]] = [(start, LEFT)]
        self.distance = 0.0
        self.chains: tuple[list[Point], list[Point]] = ([], [])

    def copy(self) -> Funnel:
        """Return a copy that further gates can be added to."""
        other = Funnel.__new__(Funnel)
        other.passed, other.distance = self.passed.copy(), self.distance
        other.chains = (self.chains[0].copy(), self.chains[1].copy())
        return other

    def narrow(self, p: Point, side: int) -> None:
        """Replace the end of the last gate on a side."""
        px, py = p
        chain, sign = self.chains[side], 1 - 2 * side
        while chain:
            (ax, ay), (bx, by) = chain[-2] if len(chain) > 1 else self.passed[-1][0], chain[-1]
            bend = sign * ((bx - ax) * (py - by) - (by - ay) * (px - bx))
            if bend > 0 or (not bend and (bx - ax) * (px - bx) + (by - ay) * (py - by) >= 0):
                chain.append(p)
                return
            chain.pop()
        other = self.chains[1 - side]
        ax, ay = self.passed[-1][0]
        k = 0
        while k < len(other):
            bx, by = other[k]
            if sign * ((bx - ax) * (py - ay) - (by - ay) * (px - ax)) >= 0:
                break
            self.distance += math.sqrt((bx - ax) ** 2 + (by - ay) ** 2)
            self.passed.append((other[k], 1 - side))
            ax, ay = bx, by
            k += 1
        del other[:k]
        chain.append(p)

    def corners(self, side: int) -> list[tuple[Point, int]]:
        """Return the shortest path to the end of the last gate on a side."""
        return self.passed + [(p, side) for p in self.chains[side]]

    def length(self, side: int) -> float:
        """Return the length of the shortest path to the end of the last gate on a side."""
        total, a = self.distance, self.passed[-1][0]
        for b in self.chains[side]:
            total += math.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2)
            a = b
        return total

    def distance_to_gate(self) -> float:
        """Return a lower bound on the distance of all points of the last gate."""
        a = self.passed[-1][0]
        if not (self.chains[0] and self.chains[1]):
            return self.distance
        (x, y), (u, v) = self.chains[0][-1], self.chains[1][-1]
        dx, dy, px, py = u - x, v - y, a[0] - x, a[1] - y
        t = min(max((px * dx + py * dy) / (dx * dx + dy * dy), 0.0), 1.0)
        return self.distance + math.sqrt((px - t * dx) ** 2 + (py - t * dy) ** 2)


@dataclass(frozen=True)
class Node:
    """Triangle of the cover.

    Attributes
    ----------
    parent
        Index of the node that the base is behind; -1 for the base's own triangle.
    depth
        Number of nodes between this one and the base's.
    gate
        Indices of the points on the left and on the right of the edge to the parent, seen from
        there.
    farthest
        Upper bound on the distance of the points of this edge from the base.
    """

    triangle: int
    parent: int
    depth: int
    gate: tuple[int, int]
    farthest: float


@dataclass(frozen=True)
class Vertex:
    """Place, and a class of the tether there.

    Attributes
    ----------
    place
        Index of the place.
    node
        Index of the node that holds it.
    at
        Grid point of the place.
    reach
        Lower bound on the length of the taut tether in the plane, in grid units.
    """

    place: int
    node: int
    at: Point
    reach: float


class CoveringTree:
    """Part of the cover within reach, in depth-first order.

    Attributes
    ----------
    nodes : list of Node
        Triangles of the cover, parents first.
    vertices : list of Vertex
        Places within reach, in the order of their nodes; the first one is the base.
    end : list of int
        For each node, one more than the last node behind it.
    """

    def __init__(self, triangulation: Triangulation, reach: float, max_nodes: int) -> None:
        self.triangulation = triangulation
        self.nodes: list[Node] = []
        self.end: list[int] = []
        located = [triangulation.locate(k) for k in range(len(triangulation.problem.places))]
        self._places: dict[int, list[int]] = {}
        for k, (t, _) in enumerate(located[1:], 1):
            self._places.setdefault(t, []).append(k)
        self._at, self._reach = [at for _, at in located], reach
        self.vertices = [Vertex(0, 0, self._at[0], 0.0)]
        points = triangulation.points
        stack = [(located[0][0], -1, 0, (-1, -1), Funnel(self._at[0]))]
        while stack:
            t, parent, depth, gate, funnel = stack.pop()
            index = len(self.nodes)
            if index >= max_nodes:
                raise Refused(f"the cover within reach has more than {max_nodes} triangles")
            farthest = max(funnel.length(LEFT), funnel.length(RIGHT)) if gate[0] >= 0 else 0.0
            self.nodes.append(Node(t, parent, depth, gate, farthest))
            self._add_vertices(t, index, funnel)
            a, b, c = triangulation.triangles[t]
            for left, right in ((b, a), (c, b), (a, c)):
                onward = triangulation.left.get((left, right))
                if onward is None or (right, left) == gate:
                    continue
                further = funnel.copy()
                if left != gate[0]:
                    further.narrow(points[left], LEFT)
                if right != gate[1]:
                    further.narrow(points[right], RIGHT)
                if further.distance_to_gate() <= reach:
                    stack.append((onward, index, depth + 1, (left, right), further))
        self.end = list(range(1, len(self.nodes) + 1))
        for k in range(len(self.nodes) - 1, 0, -1):
            parent = self.nodes[k].parent
            self.end[parent] = max(self.end[parent], self.end[k])

    def gates(self, u: Vertex, v: Vertex) -> list[tuple[int, int]]:
        """Return the indices of the left and right ends of all edges between two vertices."""
        back: list[tuple[int, int]] = []
        out: list[tuple[int, int]] = []
        a, b = u.node, v.node
        while a != b:
            if self.nodes[a].depth >= self.nodes[b].depth:
                left, right = self.nodes[a].gate
                back.append((right, left))
                a = self.nodes[a].parent
            else:
                out.append(self.nodes[b].gate)
                b = self.nodes[b].parent
        return back + out[::-1]

    def digest(self) -> str:
        """Return a hash of all vertices."""
        text = ";".join(f"{v.place},{v.node}" for v in self.vertices)
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    def _add_vertices(self, t: int, node: int, funnel: Funnel) -> None:
        for k in self._places.get(t, ()):
            last = funnel.copy()
            last.narrow(self._at[k], LEFT)
            if last.length(LEFT) <= self._reach:
                self.vertices.append(Vertex(k, node, self._at[k], last.length(LEFT)))
