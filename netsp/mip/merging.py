"""The shortest tour of the legs of many tours.

From one start or another, ruin and recreate ends in tours that are some tenths of a percent apart
and have nine legs of ten in common. A program over the legs of all of them has little to choose
from, and is solved in a second or two where one over their classes is out of reach; its tour is
shorter than any of theirs. Source: Cook & Seymour 2003, "Tour merging via branch-decomposition",
for the travelling salesperson; here the tours may also differ in the classes that they visit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from netsp.clock import Clock
from netsp.solving.limits import Limits
from netsp.solving.searching import SearchingRun
from netsp.travel.graph import TravelGraph
from netsp.travel.result import Result

MERGED = 8
"""Searches from the start whose tours are merged. With 500 goals, 8 or 32 of them, of 25,000 rounds
or 200,000 each, end in the same tour or within 0.02 %."""

SEARCHED = 0.75
"""Part of the time that is left which these may take, before their tours are merged."""

Prove = Callable[[TravelGraph, Limits], Result]


def search_and_merge(run: SearchingRun, prove: Prove) -> None:
    """Search from the start and merge the tours, again beside the best one, until the time is up;
    not at all if it is not limited, or iterations are."""
    while run.clock.limit and run.iteration_limit == np.inf and not run.done:
        run.check()
        tours = run.search_from_start(MERGED, run.clock.part(SEARCHED))
        limits = Limits(Clock.of(run.clock), rng=run.rng)
        run.update_incumbent(merged(run.graph, tours, prove, limits))
        run.report("merged")


def merged(
    graph: TravelGraph, tours: Sequence[Sequence[int]], prove: Prove, limits: Limits
) -> list[int] | None:
    """The shortest tour of the legs of some tours, or as good a one as the limits leave; None if
    there is none."""
    if not tours:
        return None
    vertices = np.unique(np.concatenate([np.asarray(t, dtype=np.int64) for t in tours]))
    used = np.zeros((len(vertices), len(vertices)), dtype=bool)
    for tour in tours:
        at = np.searchsorted(vertices, tour)
        used[at, np.roll(at, -1)] = used[np.roll(at, -1), at] = True
    costs = np.where(used, graph.costs_among(vertices, used), np.inf)
    best = np.searchsorted(vertices, min(tours, key=graph.tour_length)).tolist()
    part = TravelGraph.from_costs(costs, graph.cluster[vertices])
    found = prove(part, replace(limits, warm_start=best))
    return None if found.tour is None else vertices[list(found.tour)].tolist()
