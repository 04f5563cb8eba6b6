"""A bound from the goals alone: the travelling salesperson's tour over the shortest paths between
them in any class. It is weak, true, and had in a second where there are thousands of classes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from netsp.arrays import Floats
from netsp.lns import Instance
from netsp.solving.limits import Limits
from netsp.travel.graph import TravelGraph
from netsp.travel.result import Result

ROUNDING = 1e-9
"""The paths are shortest up to this, relative."""

Prove = Callable[[TravelGraph, Limits], Result]


def bound_over_goals(graph: TravelGraph, prove: Prove, limits: Limits) -> float:
    """No tour of the graph is shorter; 0 if the limits leave nothing.

    prove : a solver that bounds.
    """
    over = TravelGraph.from_costs(between_goals(graph), range(graph.goal_count + 1))
    return (prove(over, limits).lower_bound or 0.0) * (1.0 - ROUNDING)


def between_goals(graph: TravelGraph) -> Floats:
    """(n + 1, n + 1) no more than any leg between two goals, in any class."""
    if not graph.geometric:
        return Instance.of(graph).cluster_costs
    detours = graph.detours(sub_goals=False)
    places = range(graph.goal_count + 1)
    shortest = np.array([[detours.length(a, b) for b in places] for a in places])
    return np.asarray(np.minimum(shortest, shortest.T))
