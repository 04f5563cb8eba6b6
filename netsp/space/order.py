"""The order in which to visit waypoints so that the tether stays short: NE-TSP in space.

Two ways are tried, and the better is kept: a tour of states and legs (`netsp.space.plan`), and the
older one that is below, which is better for some bodies with many free ends. Each order is flown
before it is believed.

The older one. A waypoint and the class of its tether make one vertex, and legs belong to classes,
so that no tour can wind the tether up, as offline. Classes are found by the tether model: the
shortest tether to each waypoint, and those that come of going straight on to it from its
neighbours. A leg within a class is the straight line if the tether that comes of it is that of the
class; between any two classes there is the path back along one tether and out along the other,
pulled taut. What comes out is a generalised TSP, which our own solvers take.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from netsp.errors import InputError, LimitReachedError
from netsp.geometry import polylines
from netsp.lns import Instance, best_classes
from netsp.online.log import Run
from netsp.online.mission import Mission
from netsp.online.paths.tree import ShortestTree, taut
from netsp.online.scene.field import DistanceField
from netsp.online.simulate import grid_of, simulate
from netsp.online.tether import GeodesicTether, Tether
from netsp.solvers.solve import solve_graph
from netsp.space.plan import SHARE, SpacePlan, plan
from netsp.space.states import alike
from netsp.space.water import straight
from netsp.travel.graph import TravelGraph

NEIGHBOURS = 12
"""Waypoints nearest to each that legs are sought to."""

MOST_CLASSES = 3
"""Classes of tether kept for each waypoint."""

ROUNDS = 150
"""Of pulling a tether taut."""


@dataclass(frozen=True)
class Ordered:
    """A mission in another order.

    Parameters
    ----------
    mission : Mission
        With its waypoints reordered.
    order : tuple of int
        Old numbers in the new order.
    before : Run
        The given order, flown by `predictive`.
    after : Run
        The new order; the same as `before` when no better one was found.
    plan : SpacePlan or None
        The tour of states and legs, whether its order was the best or not; None where none was
        found.
    """

    mission: Mission
    order: tuple[int, ...]
    before: Run
    after: Run
    plan: SpacePlan | None


@dataclass
class _Classes:
    """Tethers to the waypoints: waypoint and state of each vertex."""

    point: list[int]
    tether: list[Tether]

    def find(self, n: int, tether: Tether, delta: float) -> int | None:
        """The vertex of a waypoint with the same tether."""
        for v, (m, other) in enumerate(zip(self.point, self.tether, strict=True)):
            if m == n and alike(tether, other, delta):
                return v
        return None


def reorder(
    mission: Mission, *, time_limit: float = 20.0, seed: int = 0,
    on_progress: Callable[[str], None] | None = None,
) -> Ordered:  # fmt: skip
    """Find an order of a mission's waypoints with less total time in which the tether fits.

    Total time is that of the inspection and of tether recovery afterwards. The new order is flown
    by `predictive` before it is believed; the given one is kept unless the new one visits as many
    waypoints, never exceeds the tether and takes less time.

    Parameters
    ----------
    mission : Mission
        The mission.
    time_limit : float
        Seconds of each solver.
    seed : int
        Of the solver.
    on_progress : callable, optional
        Called with a line of text now and then.

    Returns
    -------
    Ordered
        Both orders and their runs.

    Raises
    ------
    InputError
        As of `simulate`; a mission whose anchor moves.
    """
    if mission.track:
        raise InputError("track: a moving anchor has no one best order; expected a mission without")
    tell = on_progress or (lambda _: None)
    scene = mission.load_scene()
    field = scene.field()
    mission = mission.checked_waypoints(field).model_copy(update={"camera": None})
    tell("flying the given order")
    before = simulate(mission, scene=scene, field=field)
    _not_interrupted(before)
    tours = []
    planned = None
    try:
        planned = plan(mission, field=field, time_limit=time_limit, seed=seed, on_progress=tell)
        tours.append(planned.order)
    except LimitReachedError as error:
        tell(str(error))
    tell("tethers and legs, the older way")
    graph, points, start = waypoint_graph(mission, field, scene_grid=grid_of(mission, scene, field))
    given = [start.index(n) + 1 for n in range(len(mission.waypoints)) if n in start]
    tell("order")
    instance = Instance.of(graph)
    _, warm = best_classes(np.array(given), instance.start, instance.costs)
    result = solve_graph(
        graph, "lns", time_limit=time_limit, iteration_limit=400, seed=seed,
        warm_start=[int(v) for v in instance.original(warm)],
    )  # fmt: skip
    assert result.tour is not None
    best, after = tuple(range(len(mission.waypoints))), before
    tours.append(tuple(points[v] for v in result.tour[1:]))
    for k, tour in enumerate(dict.fromkeys(tours)):
        rest = [n for n in range(len(mission.waypoints)) if n not in tour]
        for direction, candidate in (("forward", tour), ("in reverse", tour[::-1])):
            order = (*candidate, *rest)
            tell(f"flying order {k + 1} {direction}")
            run = simulate(_in_order(mission, order), scene=scene, field=field)
            _not_interrupted(run)
            if _better(run, after):
                best, after = order, run
    full = Mission.model_validate(_in_order(mission, best).model_dump())
    return Ordered(full, best, before, after, planned)


def _not_interrupted(run: Run) -> None:
    """Ctrl-C ends a flight with what there is of it; here it is to end all."""
    if run.summary["status"] == "interrupted":
        raise KeyboardInterrupt


def _in_order(mission: Mission, order: tuple[int, ...]) -> Mission:
    return mission.model_copy(update={"waypoints": tuple(mission.waypoints[n] for n in order)})


def _better(run: Run, than: Run) -> bool:
    a, b = run.summary, than.summary
    return bool(
        a["visited"] >= b["visited"]
        and a["exceedance_s"] <= b["exceedance_s"]
        and a["total_s"]["tether"] < b["total_s"]["tether"]
    )


def waypoint_graph(
    mission: Mission, field: DistanceField, scene_grid: object
) -> tuple[TravelGraph, list[int], list[int]]:
    """Classes and legs of a mission.

    Waypoints that no tether reaches are left out.

    Parameters
    ----------
    mission : Mission
        The mission.
    field : DistanceField
        Its scene.
    scene_grid : Grid
        The grid that paths are sought on.

    Returns
    -------
    graph : TravelGraph
        Classes of the waypoints, and legs.
    at : list of int
        The waypoint of each vertex, -1 for the anchor.
    clusters : list of int
        The waypoints in the order of the clusters.
    """
    grid = scene_grid
    model = GeodesicTether(field, mission.delta)
    anchor, limit = np.array(mission.anchor), SHARE * mission.tether_length
    points = mission.places
    tree = ShortestTree(grid, anchor, points)  # type: ignore[arg-type]
    found = _Classes([], [])
    for n in range(len(points)):
        path = tree.path(n)
        if path is None:
            continue
        tether = model.relaxed(path[::-1], 2 * ROUNDS)
        if tether.length <= limit:
            found.point.append(n)
            found.tether.append(tether)
    near = np.argsort(np.linalg.norm(points[:, None] - points[None], axis=2), axis=1)[
        :, 1 : NEIGHBOURS + 1
    ]
    direct: dict[tuple[int, int], float] = {}
    v = 0
    while v < len(found.point):
        n = found.point[v]
        for m in near[n]:
            if not straight(field, points[n], points[m], mission.clearance):
                continue
            path = np.array([points[n], points[m]])
            there, lengths = model.drive(found.tether[v], path[1:])
            if lengths.max() > limit:
                continue
            w = found.find(int(m), there, mission.delta)
            if w is None and found.point.count(int(m)) < MOST_CLASSES:
                w = len(found.point)
                found.point.append(int(m))
                found.tether.append(there)
            if w is not None:
                direct[v, w] = float(np.linalg.norm(path[1] - path[0]))
        v += 1
    count = len(found.point)
    reach = np.array([t.length for t in found.tether])
    costs = np.zeros((count + 1, count + 1))
    costs[1:, 1:] = reach[:, None] + reach[None, :]
    costs[0, 1:] = costs[1:, 0] = reach
    neighbours = {(n, int(m)) for n in range(len(points)) for m in near[n]}
    for v in range(count):
        for w in range(v + 1, count):
            pair = (found.point[v], found.point[w])
            if pair not in neighbours and pair[::-1] not in neighbours:
                continue
            leg = min(direct.get((v, w), np.inf), direct.get((w, v), np.inf))
            if not np.isfinite(leg):
                line = np.vstack([found.tether[v].nodes[::-1], found.tether[w].nodes[1:]])
                path = taut(field, line, mission.clearance, mission.delta)
                leg = polylines.length(path)
            costs[v + 1, w + 1] = costs[w + 1, v + 1] = min(leg, costs[v + 1, w + 1])
    reached = sorted(set(found.point))
    if not reached:
        raise InputError("waypoints: no tether within the limit reaches any of them")
    cluster = [0, *(reached.index(n) + 1 for n in found.point)]
    return TravelGraph.from_costs(costs, cluster), [-1, *found.point], reached
