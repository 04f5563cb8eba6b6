"""Shortest tour with the goals in a given order: a shortest path through layers of classes.

A layer holds the classes of one goal; only legs between neighbouring layers are measured. The tour
is optimal among those of the order.
"""

from __future__ import annotations

import numpy as np

from netsp.base.clock import Clock
from netsp.base.errors import InputError
from netsp.gtsp.search.layers import LayeredInstance, best_classes
from netsp.gtsp.travel.result import OnProgress, Progress, Result
from netsp.model.arrangement import respects_precedences
from netsp.model.bound_scope import LowerBound
from netsp.model.solution import Status
from netsp.roadmap.travel_graph import TravelGraph


def solve_in_order(graph: TravelGraph, clock: Clock, on_progress: OnProgress | None) -> Result:
    """Return the shortest tour that visits the goals in the order of their numbers.

    Parameters
    ----------
    graph : TravelGraph
        Graph of a problem without a state.
    clock : Clock
        Clock of the run.
    on_progress : callable, optional
        Called once.

    Raises
    ------
    InputError
        The tour starts at a state, or the order breaks a precedence.
    LimitReachedError
        Time was up before the legs were measured.
    """
    if graph.start is not None:
        raise InputError("keep_order: a tour from a state is planned afresh; expected none")
    if not respects_precedences(range(1, graph.goal_count + 1), graph.before):
        raise InputError(
            "keep_order: the order of the file breaks an 'after' of its goals; expected one that "
            "keeps them all"
        )
    all_vertices = np.arange(len(graph))
    steps = graph.cluster[:, None] - graph.cluster[None, :]
    last = graph.goal_count
    needed = (np.abs(steps) == 1) | (np.abs(steps) == last)
    with graph.on_clock(clock):
        instance = LayeredInstance(graph.cluster, graph.costs_among(all_vertices, needed))
    order = np.arange(1, last + 1, dtype=np.int64)
    length, tour = best_classes(order, instance.start, instance.costs)
    found = instance.original(tour)
    bound = LowerBound(float(length), graph.scope.in_order)
    if on_progress is not None:
        on_progress(Progress(clock.elapsed, "in order", bound.length, bound, tour=found))
    return Result(found, bound.length, bound.length, Status.OPTIMAL, lower_bound_of=bound.scope)
