"""A bound from the goals alone: the travelling salesperson's tour over the shortest paths between
them in any class. It is weak, true, and had in a second where there are thousands of classes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from netsp.clock import Clock
from netsp.solving.limits import Limits
from netsp.travel.graph import TravelGraph
from netsp.travel.result import Result

ROUNDING = 1e-9
"""The paths are shortest up to this, relative."""

Prove = Callable[[TravelGraph, Limits], Result]


def bound_over_goals(graph: TravelGraph, prove: Prove, limits: Limits) -> float:
    """No tour of the graph is shorter; 0 if the limits leave nothing.

    Parameters
    ----------
    prove
        A solver that bounds.
    """
    clock = Clock.of(limits.time)
    least = graph.between_goals(lambda: clock.up)
    over = TravelGraph.from_costs(least, range(graph.goal_count + 1))
    bound = (prove(over, replace(limits, time=clock)).lower_bound or 0.0) * (1.0 - ROUNDING)
    graph.bound_in_any_class = max(graph.bound_in_any_class, bound)
    return bound
