"""A bound on every tour of a mission's waypoints, whatever the tether does.

No tour is shorter than the shortest one of the robot alone, which goes from waypoint to waypoint
along the shortest paths there are. Between waypoints in sight of one another these are straight,
and between those that are not near, the straight distance is a bound, too. For the others the
shortest of the ways found is taken, pulled taut in each of several classes
(`netsp.space.legs.Ways`): a measured length, which nothing proves the shortest. What is proven is
the tour through these distances.
"""

from __future__ import annotations

import numpy as np

from netsp.clock import Clock
from netsp.roadmap.from_state import from_state
from netsp.solvers.solve import solve_graph
from netsp.space.legs import Ways
from netsp.space.water import along
from netsp.travel.graph import TravelGraph


def bound_of_all(ways: Ways, reached: list[int], clock: Clock, seed: int = 0) -> float | None:
    """A bound on all tours through waypoints.

    Parameters
    ----------
    ways : Ways
        Of the robot between waypoints.
    reached : list of int
        The waypoints of the tours.
    clock : Clock
        When it is up, the bound is what is proven by then.
    seed : int
        Of the solver.

    Returns
    -------
    float or None
        Metres; None if there was no time for any, or nothing is to be visited but the start.
    """
    places = ways.places
    visited = set(reached)
    some = [n for n in range(len(places)) if n == places.begin or places.waypoint[n] in visited]
    points = np.vstack([np.array(ways.water.mission.start), places.points[some]])
    costs = np.linalg.norm(points[:, None] - points[None], axis=2)
    for a, n in enumerate(some, 1):
        for b, m in enumerate(some[: a - 1], 1):
            lengths = [along(path) for _, path in ways.known(n, m)]
            if lengths:
                # the taut one may be a hair shorter than the straight distance by rounding
                costs[a, b] = costs[b, a] = max(costs[a, b], min(lengths))
    cluster = np.r_[0, 1 + np.unique(places.waypoint[some], return_inverse=True)[1]]
    graph = TravelGraph.from_costs(costs, cluster)
    if places.begin is not None:
        graph = from_state(graph, 1 + some.index(places.begin))
    return solve_graph(graph, "auto", time_limit=clock, seed=seed).lower_bound or None
