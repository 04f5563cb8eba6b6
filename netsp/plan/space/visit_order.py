"""Order of waypoints in which the tether stays short by going straight on.

A tour along states and legs (`netsp.plan.space.space_plan`) is usually shorter; this order is
better for some bodies with many free ends. A waypoint and a class of its tether make one vertex,
and legs belong to classes, so no tour can wind the tether up. The tether model finds the classes:
the shortest tether to each waypoint, and the tethers that result from going straight on from
neighbouring waypoints. A leg is the straight line if the resulting tether is that of the class. For
any two classes there is also the path back along one tether and out along the other, pulled taut.
The result is a generalised TSP for netsp's own solvers.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from netsp.base.arrays import Ints
from netsp.base.clock import Clock
from netsp.base.errors import InputError
from netsp.base.geometry import polylines
from netsp.gtsp.search import LayeredInstance, best_classes
from netsp.plan.solve_problem import solve_graph
from netsp.plan.space.mission_policy import MissionPolicy
from netsp.plan.space.planning_context import drive_step, is_straight_clear
from netsp.plan.space.states import hang_alike
from netsp.roadmap.travel_graph import TravelGraph
from netsp.world.mission.mission import Mission
from netsp.world.mission.mission_tether import mission_tether
from netsp.world.paths.tree import Grid, ShortestTree, pull_taut
from netsp.world.scene.field import DistanceField
from netsp.world.tether import Tether


@dataclass
class _Classes:
    """Tethers to the waypoints: number of the waypoint and tether of each vertex."""

    point: list[int]
    tether: list[Tether]

    def find(self, n: int, tether: Tether, delta: float) -> int | None:
        """Return the vertex of a waypoint with a tether that hangs alike; None if there is none."""
        for v, (m, other) in enumerate(zip(self.point, self.tether, strict=True)):
            if m == n and hang_alike(tether, other, delta):
                return v
        return None


def order_by_going_on(
    mission: Mission,
    field: DistanceField,
    grid: Grid,
    *,
    clock: Clock,
    seed: int = 0,
    policy: MissionPolicy | None = None,
) -> tuple[int, ...]:
    """Return the shortest order of a mission's waypoints along straight legs and taut tethers.

    Parameters
    ----------
    mission : Mission
        Mission whose order is the warm start.
    clock : Clock
        Clock of the run; when it is up, the best order so far is returned.
    policy : MissionPolicy, optional
        Effort, and share of the tether.

    Returns
    -------
    tuple of int
        Waypoints; without any that no tether reaches.

    Raises
    ------
    InputError
        No tether reaches any of them.
    LimitReachedError
        The time was up before legs were known.
    """
    policy = policy or MissionPolicy()
    graph, points, start = waypoint_graph(mission, field, grid, clock, policy)
    given_order = [start.index(n) + 1 for n in range(len(mission.waypoints)) if n in start]
    instance = LayeredInstance.of_graph(graph)
    _, warm_start = best_classes(np.array(given_order), instance.start, instance.costs)
    result = solve_graph(
        graph,
        "lns",
        time_limit=clock,
        iteration_limit=policy.going_on.max_iterations,
        seed=seed,
        warm_start=[int(v) for v in instance.original(warm_start)],
    )
    assert result.tour is not None
    return tuple(points[v] for v in result.tour[1:])


def waypoint_graph(
    mission: Mission,
    field: DistanceField,
    grid: Grid,
    clock: Clock | None = None,
    policy: MissionPolicy | None = None,
) -> tuple[TravelGraph, list[int], list[int]]:
    """Return the travel graph of a mission's waypoints, without waypoints that no tether reaches.

    Parameters
    ----------
    clock : Clock, optional
        Clock of the run; when it is up, there is no graph.
    policy : MissionPolicy, optional
        Effort, and share of the tether.

    Returns
    -------
    graph : TravelGraph
        Classes of the waypoints, and legs.
    at : list of int
        Waypoint of each vertex, -1 for the anchor.
    clusters : list of int
        Waypoints in the order of the clusters.

    Raises
    ------
    InputError
        No tether reaches any of them.
    LimitReachedError
        The time was up.
    """
    clock, policy = clock or Clock(), policy or MissionPolicy()
    points = mission.places
    found = _shortest_tethers(mission, field, grid, clock, policy)
    nearest = np.argsort(np.linalg.norm(points[:, None] - points[None], axis=2), axis=1)[
        :, 1 : policy.going_on.n_neighbours + 1
    ]
    straight_legs = _drive_straight_legs(mission, field, found, nearest, clock, policy)
    count = len(found.point)
    lengths = np.array([t.length for t in found.tether])
    costs = np.zeros((count + 1, count + 1))
    costs[1:, 1:] = lengths[:, None] + lengths[None, :]
    costs[0, 1:] = costs[1:, 0] = lengths
    neighbours = {(n, int(m)) for n in range(len(points)) for m in nearest[n]}
    for v in range(count):
        clock.check("pulling legs taut")
        for w in range(v + 1, count):
            pair = (found.point[v], found.point[w])
            if pair not in neighbours and pair[::-1] not in neighbours:
                continue
            leg = min(straight_legs.get((v, w), np.inf), straight_legs.get((w, v), np.inf))
            if not np.isfinite(leg):
                line = np.vstack([found.tether[v].nodes[::-1], found.tether[w].nodes[1:]])
                path = pull_taut(field, line, mission.clearance, mission.delta)
                leg = polylines.length(path)
            costs[v + 1, w + 1] = costs[w + 1, v + 1] = min(leg, costs[v + 1, w + 1])
    reached = sorted(set(found.point))
    if not reached:
        raise InputError("waypoints: no tether within the limit reaches any of them")
    cluster = [0, *(reached.index(n) + 1 for n in found.point)]
    return TravelGraph.from_costs(costs, cluster), [-1, *found.point], reached


def _shortest_tethers(
    mission: Mission, field: DistanceField, grid: Grid, clock: Clock, policy: MissionPolicy
) -> _Classes:
    """Return the shortest tether to each waypoint that one reaches."""
    model, points = mission_tether(mission, field), mission.places
    limit = policy.tether_share * mission.tether_length
    tree = ShortestTree(grid, np.array(mission.anchor), points)
    found = _Classes([], [])
    for n in range(len(points)):
        clock.check("looking for tethers to waypoints")
        path = tree.path(n)
        if path is None:
            continue
        tether = model.relaxed(path[::-1], policy.going_on.max_pull_rounds)
        if tether.length <= limit:
            found.point.append(n)
            found.tether.append(tether)
    return found


def _drive_straight_legs(
    mission: Mission,
    field: DistanceField,
    found: _Classes,
    nearest: Ints,
    clock: Clock,
    policy: MissionPolicy,
) -> dict[tuple[int, int], float]:
    """Drive each tether straight to the neighbours of its waypoint, add the classes in which it
    arrives, and return the lengths of the legs, metres."""
    model, points = mission_tether(mission, field), mission.places
    limit = policy.tether_share * mission.tether_length
    step = drive_step(mission, policy.tether_share)
    legs: dict[tuple[int, int], float] = {}
    v = 0
    while v < len(found.point):
        clock.check("driving straight legs")
        n = found.point[v]
        for m in nearest[n]:
            if not is_straight_clear(field, points[n], points[m], mission.clearance):
                continue
            path = np.array([points[n], points[m]])
            tether, lengths = model.drive(found.tether[v], polylines.dense(path, step))
            if lengths.max() > limit:
                continue
            w = found.find(int(m), tether, mission.delta)
            if w is None and found.point.count(int(m)) < policy.going_on.max_classes:
                w = len(found.point)
                found.point.append(int(m))
                found.tether.append(tether)
            if w is not None:
                legs[v, w] = float(np.linalg.norm(path[1] - path[0]))
        v += 1
    return legs
