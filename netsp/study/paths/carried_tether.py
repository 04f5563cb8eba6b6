"""Taut tether that a robot carries along a path.

The straight segments of a free path lift to geodesics of the covering space, whose distance
function is convex (docs/theory), so the tether is longest at a point of the path. Between two
points its length changes by at most the length of the path between them, so points that cannot beat
the longest tether found so far need no string pulling.
"""

from __future__ import annotations

import heapq
import math

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.geometry import polylines
from netsp.judge.stringpull import StringPuller


class CarriedTether:
    """Taut tethers at the points of a free path that begins at the base.

    Parameters
    ----------
    puller : StringPuller
        String puller of the judge.
    loop : ndarray, shape (n, 3)
        Points of the path, in the problem's units.

    Examples
    --------
    >>> import numpy as np
    >>> from netsp import Problem
    >>> problem = Problem(base=(0, 0), goals=[(3, 4)], obstacles=[], tether_length=9)
    >>> loop = np.array([[0.0, 0, 0], [3, 4, 0], [3, 0, 0]])
    >>> tether = CarriedTether(StringPuller(problem, 9.0), loop)
    >>> tether.length(1), tether.longest(1e-6)
    (5.0, (1, 5.0))
    """

    def __init__(self, puller: StringPuller, loop: Floats) -> None:
        self._puller, self._loop = puller, loop
        # tree of reduced sequences of crossed edges: each node has its parent and its last edge
        self._parent, self._edge = [-1], [(-1, False)]
        self._node = [0]
        for piece in puller.crossings(loop[:, :2]):
            node = self._node[-1]
            for edge, side in piece:
                node = self._after(node, edge, side)
            self._node.append(node)
        self._known: dict[int, float] = {}

    def _after(self, node: int, edge: int, side: bool) -> int:
        """Return the node after crossing an edge; crossing it back at once leads to the parent."""
        if node and self._edge[node][0] == edge:
            return self._parent[node]
        self._parent.append(node)
        self._edge.append((edge, side))
        return len(self._parent) - 1

    def _sleeve(self, node: int) -> list[tuple[int, bool]]:
        out = []
        while node:
            out.append(self._edge[node])
            node = self._parent[node]
        return out[::-1]

    def length(self, k: int) -> float:
        """Return the length of the taut tether at a point.

        Parameters
        ----------
        k : int
            Index of the point.

        Returns
        -------
        float
            In the problem's units, in 3D.
        """
        if k not in self._known:
            self._known[k] = self._pulled(self._loop[k], self._node[k])
        return self._known[k]

    def length_to(self, k: int, place: Floats) -> float:
        """Return the length of the taut tether at a place in sight of a point.

        Parameters
        ----------
        k : int
            Index of the point.
        place : ndarray, shape (3,)
            Place to which a straight free line leads from the point.

        Returns
        -------
        float
            In the problem's units, in 3D.
        """
        node = self._node[k]
        (piece,) = self._puller.crossings(np.array([self._loop[k, :2], place[:2]]))
        for edge, side in piece:
            node = self._after(node, edge, side)
        return self._pulled(place, node)

    def _pulled(self, place: Floats, node: int) -> float:
        start = self._loop[0]
        planar = self._puller.pull(start, place, self._sleeve(node)).low
        return math.hypot(planar, float(place[2] - start[2]))

    def longest(self, error: float, first: int = 0) -> tuple[int, float]:
        """Return the point at which the tether is longest, and its length there.

        Parameters
        ----------
        error : float
            Tolerance: no tether is longer than the returned length by more, in the problem's units.
        first : int
            Index of the first point considered.

        Returns
        -------
        (int, float)
            Index of the point, and the length in the problem's units.
        """
        along = np.concatenate(
            [[0.0], np.cumsum(np.linalg.norm(np.diff(self._loop, axis=0), axis=1))]
        )
        last = len(self._loop) - 1
        best = max((first, last), key=self.length)

        def bound(a: int, b: int) -> float:
            return 0.5 * (self.length(a) + self.length(b) + float(along[b] - along[a]))

        heap = [(-bound(first, last), first, last)] if last - first >= 2 else []
        while heap:
            upper_bound, a, b = heapq.heappop(heap)
            if -upper_bound <= self.length(best) + error:
                break
            # the point in the middle of the path between them
            middle = int(np.searchsorted(along, 0.5 * (along[a] + along[b])))
            middle = min(max(middle, a + 1), b - 1)
            if self.length(middle) > self.length(best):
                best = middle
            for left, right in ((a, middle), (middle, b)):
                if right - left >= 2:
                    heapq.heappush(heap, (-bound(left, right), left, right))
        return best, self.length(best)

    def profile(self, count: int) -> Floats:
        """Return the length of the tether along the path.

        Parameters
        ----------
        count : int
            Number of places, spaced evenly along the path in plan.

        Returns
        -------
        ndarray, shape (count, 2)
            Length along the path in plan, and length of the taut tether there.
        """
        s = polylines.along(self._loop[:, :2])
        out = []
        for along_loop in np.linspace(0.0, s[-1], count).tolist():
            k = min(int(np.searchsorted(s, along_loop, side="right")) - 1, len(s) - 1)
            place = np.array([np.interp(along_loop, s, self._loop[:, j]) for j in range(3)])
            out.append((along_loop, self.length_to(k, place)))
        return np.array(out)
