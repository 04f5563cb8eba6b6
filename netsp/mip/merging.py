"""Tour merging: the shortest tour through the classes of several tours.

From different starts, ruin and recreate ends in tours whose lengths differ by tenths of a percent
and which share most of their classes. A program over these classes has hardly more choices than a
travelling salesperson's, and is solved in seconds where one over all classes is out of reach; its
tour is no longer than any of the given ones. The idea is that of Cook & Seymour 2003, "Tour merging
via branch-decomposition", who use the legs of the tours alone. All legs among their classes are
worth more: they hold shorter tours than the legs of many searches do.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from netsp.base.arrays import Ints
from netsp.base.clock import Clock
from netsp.base.errors import LimitReachedError
from netsp.gtsp.instance import Instance
from netsp.gtsp.limits import Limits
from netsp.gtsp.searching import SearchingRun
from netsp.gtsp.travel.result import Result
from netsp.mip.mip_policy import MergingPolicy

Prove = Callable[[Instance, Limits], Result]
"""Solver that proves."""


def search_and_merge(
    run: SearchingRun, prove: Prove, policy: MergingPolicy = MergingPolicy()
) -> None:
    """Search from scratch and merge the tours found, repeatedly, until the time is up.

    Without a time limit, or with a limit of iterations, do nothing.
    """
    while run.clock.limit and run.iteration_limit == np.inf and not run.is_done:
        run.check()
        tours = run.search_afresh(policy.searches, run.clock.part(policy.search_time_share))
        merge(run, tours, prove, Clock.from_limit(run.clock))


def merge(run: SearchingRun, tours: Sequence[Sequence[int]], prove: Prove, clock: Clock) -> None:
    """Offer a run the shortest tour through the classes of some tours, if it is below the cutoff.

    A tour at the cutoff or above may use legs that a bound has fixed out.
    """
    with run.graph.on_clock(clock), suppress(LimitReachedError):
        found = merged_tour(run.graph, tours, prove, Limits(clock, rng=run.rng))
        if found is not None and (length := run.graph.tour_length(found)) < run.cutoff:
            run.update_incumbent(found, length=length)
    run.report("merged")


def visited_classes(tours: Iterable[Sequence[int]]) -> Ints:
    """Return all vertices that some tours visit, in order."""
    return np.unique(np.concatenate([np.asarray(t, dtype=np.int64) for t in tours]))


def merged_tour(
    graph: Instance, tours: Sequence[Sequence[int]], prove: Prove, limits: Limits
) -> list[int] | None:
    """Return the shortest tour through the classes of some tours that the limits allow to find."""
    if not tours:
        return None
    vertices = visited_classes(tours)
    part = Instance.from_costs(graph.costs_among(vertices), graph.cluster[vertices])
    known = [np.searchsorted(vertices, t).tolist() for t in tours]
    found = prove(part, replace(limits, warm_start=min(known, key=part.tour_length)))
    return None if found.tour is None else vertices[list(found.tour)].tolist()
