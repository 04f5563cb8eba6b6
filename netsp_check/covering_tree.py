"""Universal cover of a triangulation as a tree, and the places that a tether reaches in it.

Every path from the base crosses triangles; without detours back and forth these are a path in the
tree, whose nodes are the triangles of the universal cover (Lemma 5). A funnel holds the shortest
paths from one point to all points of an edge (Lee & Preparata 1984).
"""

from __future__ import annotations

import hashlib
import math
from typing import NamedTuple

from netsp_check.problem_file import Refused
from netsp_check.triangulation import Point, Triangulation

LEFT, RIGHT = 0, 1
"""Index of the left and of the right side, in the sense of travel."""


class Funnel:
    """Shortest paths from a point through gates: segments that are met in order.

    Attributes
    ----------
    passed : list of points
        Start, and the corners at which all paths turn; the last one is the apex.
    chains : pair of lists of points
        Corners from the apex, excluded, to the left and to the right end of the last gate.
    """

    __slots__ = ("_distance", "chains", "passed")

    def __init__(self, start: Point) -> None:
        self.passed, self._distance = [start], 0.0
        self.chains: tuple[list[Point], list[Point]] = ([], [])

    def copy(self) -> Funnel:
        """Return a copy for further gates, which holds only the apex of the corners passed."""
        other = Funnel.__new__(Funnel)
        other.passed, other._distance = self.passed[-1:], self._distance
        other.chains = (self.chains[0].copy(), self.chains[1].copy())
        return other

    def narrow(self, p: Point, side: int) -> None:
        """Replace the end of the last gate on a side, for the next gate."""
        px, py = p
        chain, sign = self.chains[side], 1 - 2 * side
        while chain:
            (ax, ay), (bx, by) = chain[-2] if len(chain) > 1 else self.passed[-1], chain[-1]
            bend = sign * ((bx - ax) * (py - by) - (by - ay) * (px - bx))
            if bend > 0 or (not bend and (bx - ax) * (px - bx) + (by - ay) * (py - by) >= 0):
                chain.append(p)
                return
            chain.pop()
        other, k = self.chains[1 - side], 0
        ax, ay = self.passed[-1]
        while k < len(other):
            bx, by = other[k]
            if sign * ((bx - ax) * (py - ay) - (by - ay) * (px - ax)) >= 0:
                break
            self._distance += math.sqrt((bx - ax) ** 2 + (by - ay) ** 2)
            self.passed.append(other[k])
            ax, ay, k = bx, by, k + 1
        del other[:k]
        chain.append(p)

    def length(self, side: int) -> float:
        """Return the length of the shortest path to the end of the last gate on a side."""
        total, (ax, ay) = self._distance, self.passed[-1]
        for bx, by in self.chains[side]:
            total += math.sqrt((bx - ax) ** 2 + (by - ay) ** 2)
            ax, ay = bx, by
        return total

    def distance(self) -> float:
        """Return a lower bound on the distance from the start to all points of the last gate."""
        ax, ay = self.passed[-1]
        (x, y), (u, v) = ([(ax, ay), *chain][-1] for chain in self.chains)
        dx, dy, px, py = u - x, v - y, ax - x, ay - y
        t = min(max((px * dx + py * dy) / (dx * dx + dy * dy), 0.0), 1.0)
        return self._distance + math.sqrt((px - t * dx) ** 2 + (py - t * dy) ** 2)


class Node(NamedTuple):
    """Triangle of the cover: its parent, through the gate (left, right), is nearer to the base.

    `farthest` is an upper bound on the distance of the gate's points from the base.
    """

    parent: int
    depth: int
    gate: tuple[int, int]
    farthest: float


class Vertex(NamedTuple):
    """Place in a node: a class of the tether, of length `tether` or more in the plane."""

    place: int
    node: int
    at: Point
    tether: float


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
        self.triangulation, points = triangulation, triangulation.points
        self.nodes: list[Node] = []
        held: dict[int, list[int]] = {}
        located = [triangulation.locate(k) for k in range(len(triangulation.problem.places))]
        for k, (triangles, _) in enumerate(located[1:], 1):
            for t in triangles:
                held.setdefault(t, []).append(k)
        if not located[0][0]:
            raise Refused("no triangle holds the base")
        base = located[0][1]
        self.vertices = [Vertex(0, 0, base, 0.0)]
        stack = [(located[0][0][0], Node(-1, 0, (-1, -1), 0.0), Funnel(base))]
        while stack:
            t, node, funnel = stack.pop()
            index = len(self.nodes)
            if index >= max_nodes:
                raise Refused(f"the cover within reach has more than {max_nodes} triangles")
            self.nodes.append(node)
            for k in held.get(t, ()):
                to_place, at = funnel.copy(), located[k][1]
                to_place.narrow(at, LEFT)
                if to_place.length(LEFT) <= reach:
                    self.vertices.append(Vertex(k, index, at, to_place.length(LEFT)))
            a, b, c = triangulation.triangles[t]
            for left, right in ((b, a), (c, b), (a, c)):
                onward = triangulation.left.get((left, right))
                if onward is None or (right, left) == node.gate:
                    continue
                further = funnel.copy()
                if left != node.gate[LEFT]:
                    further.narrow(points[left], LEFT)
                if right != node.gate[RIGHT]:
                    further.narrow(points[right], RIGHT)
                if further.distance() <= reach:
                    farthest = max(further.length(LEFT), further.length(RIGHT))
                    child = Node(index, node.depth + 1, (left, right), farthest)
                    stack.append((onward, child, further))
        self.end = list(range(1, len(self.nodes) + 1))
        for k in range(len(self.nodes) - 1, 0, -1):
            parent = self.nodes[k].parent
            self.end[parent] = max(self.end[parent], self.end[k])

    def gates(self, u: Vertex, v: Vertex) -> list[tuple[int, int]]:
        """Return the gates between two vertices as indices of their left and right ends."""
        back, out = [], []
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
