"""Legs of a robot that keeps farther from upright obstacles than its tether.

The tether touches obstacles, and the robot keeps a clearance. So the classes that the tether allows
are those of one problem of the plane, and the lengths of the legs between them are those of another
one, with the same obstacles and more clearance. Both problems have the same rays, so a word means
the same class in both.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.clock import Clock
from netsp.hsignature import concatenate, invert
from netsp.model.problem import Problem
from netsp.roadmap.paths import TautPaths, UnknownPathError
from netsp.roadmap.travel_graph import TravelGraph


class ClearanceLegs:
    """Legs between the classes of a tether, with lengths for a robot that keeps a clearance.

    A leg costs its length without the clearance until `raise_along` has measured it: a lower bound,
    because the robot's taut path is a path of the tether's problem, too.

    Parameters
    ----------
    graph : TravelGraph
        Classes of the tether, and the legs between them without the robot's clearance.
    robot_problem : Problem
        The same obstacles and goals with the clearance of the robot.
    missing_cost : float, optional
        Cost of a leg whose path is not found. By default its length without the clearance, which is
        still a lower bound; infinite for a caller that needs the path.
    clock : Clock, optional
        Clock of the run.

    Attributes
    ----------
    costs : ndarray, shape (v, v)
        Costs of the legs, in units of the problem.

    Raises
    ------
    LimitReachedError
        The clock was up before the legs without the clearance were measured.

    Examples
    --------
    >>> from netsp import Problem, travel_graph
    >>> from netsp.plan.space.clearance_legs import ClearanceLegs
    >>> post = {"center": (2, 0), "radius": 0.5}
    >>> problem = Problem(base=(0, 0), goals=[(4, 0)], obstacles=[post], tether_length=6)
    >>> legs = ClearanceLegs(travel_graph(problem), problem.model_copy(update={"clearance": 0.1}))
    >>> before = float(legs.costs[0, 1])
    >>> grown = legs.raise_along([0, 1])
    >>> grown, round(before, 3), round(float(legs.costs[0, 1]), 3)
    (True, 4.126, 4.181)
    """

    def __init__(
        self,
        graph: TravelGraph,
        robot_problem: Problem,
        missing_cost: float | None = None,
        clock: Clock | None = None,
    ) -> None:
        self.graph, self._missing_cost = graph, missing_cost
        self._paths = TautPaths(robot_problem, clock=clock)
        self.costs: Floats = np.array(graph.costs_among(np.arange(len(graph))))
        self._measured: set[tuple[int, int]] = set()

    def raise_along(self, vertices: Sequence[int]) -> bool:
        """Measure the legs between consecutive vertices; return whether a cost has grown."""
        has_grown = False
        for u, v in pairwise(vertices):
            leg = (min(u, v), max(u, v))
            if u == v or leg in self._measured:
                continue
            self._measured.add(leg)
            try:
                length = self._paths.length(*self._ends(*leg))
            except UnknownPathError:
                if self._missing_cost is None:
                    continue
                length = self._missing_cost
            if length > self.costs[leg]:
                self.costs[u, v] = self.costs[v, u] = length
                has_grown = True
        return has_grown

    def path(self, u: int, v: int) -> Floats:
        """Return the path (k, 3) of the robot along a leg.

        Raises
        ------
        UnknownPathError
            No path of the leg's class was found.
        """
        if u > v:
            return self.path(v, u)[::-1].copy()
        return self._paths.path(*self._ends(u, v))

    def _ends(self, u: int, v: int) -> tuple[int, int, tuple[int, ...]]:
        """Return the points of two vertices, and the word between them."""
        signatures, cluster = self.graph.signatures, self.graph.cluster
        word = concatenate(invert(signatures[u]), signatures[v])
        return int(cluster[u]), int(cluster[v]), word
