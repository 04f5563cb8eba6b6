"""Tours of a tethered robot along given paths, made without netsp's search for tours.

Trees need neither the tether model nor the judge: a robot that goes out along a tree of paths and
back along the same ones has a tether no longer than its path from the start, and comes home free.
Other orders are driven with the tether model, and judged by `netsp.plan.space.judge`.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from free_paths import FreePaths, keeps, length_of

from netsp.base.arrays import Floats, Ints
from netsp.model.solution import Status
from netsp.plan.space.board import DrivenTour
from netsp.plan.space.driven_legs import LegTo, drive_legs
from netsp.plan.space.judge import verify_mission
from netsp.plan.space.planning_context import PlanningContext
from netsp.world.mission.mission import Mission
from netsp.world.mission.planned_tour import PlannedTour, PlannedVisit
from netsp.world.scene.scene import Scene
from netsp.world.tether import Tether


def shortest_order(costs: Floats, cluster: Ints) -> tuple[float, list[int]]:
    """Return the shortest closed tour from vertex 0 through one vertex of each cluster, by dynamic
    programming over sets of clusters; infinite if there is none.

    Parameters
    ----------
    cluster : ndarray, shape (v,)
        Number of each vertex's cluster, from 1 on; 0 for vertex 0.
    """
    n, v = int(cluster.max()), len(costs)
    best = np.full((1 << n, v), np.inf)
    before = np.full((1 << n, v), -1, dtype=np.int64)
    for w in range(1, v):
        best[1 << (cluster[w] - 1), w] = costs[0, w]
    for done in range(1, 1 << n):
        row = best[done]
        if not np.isfinite(row).any():
            continue
        through = row[:, None] + costs
        least, which = through.min(0), through.argmin(0)
        for w in range(1, v):
            bit = 1 << (cluster[w] - 1)
            if not done & bit and least[w] < best[done | bit, w]:
                best[done | bit, w], before[done | bit, w] = least[w], which[w]
    done = (1 << n) - 1
    home = best[done] + costs[:, 0]
    at = int(home.argmin())
    length, order = float(home[at]), []
    if not np.isfinite(length):
        return length, []
    while at > 0:
        order.append(at)
        at, done = int(before[done, at]), done & ~(1 << (cluster[at] - 1))
    return length, order[::-1]


def order_by_pyvrp(costs: Floats, cluster: Ints, iterations: int = 300) -> tuple[float, list[int]]:
    """Return a tour that PyVRP finds on the same lengths.

    Raises
    ------
    ImportError
        PyVRP is not installed; it comes with the extra `bench`.
    """
    from pyvrp import Model
    from pyvrp.stop import MaxIterations

    scale, model, v = 1e6, Model(), len(costs)
    places = [model.add_location(float(n), 0.0) for n in range(v)]
    model.add_depot(places[0])
    model.add_vehicle_type(1)
    sizes = np.bincount(cluster)
    groups = {c: model.add_client_group() for c in np.flatnonzero(sizes > 1) if c > 0}
    for w in range(1, v):
        grouped = int(cluster[w]) in groups
        model.add_client(
            places[w], group=groups[int(cluster[w])] if grouped else None, required=not grouped
        )
    for a, b in itertools.permutations(range(v), 2):
        if np.isfinite(costs[a, b]):
            model.add_edge(places[a], places[b], distance=round(float(costs[a, b]) * scale))
    found = model.solve(stop=MaxIterations(iterations), display=False, seed=0).best
    if not found.is_feasible():
        return np.inf, []
    order = [s.idx + 1 for s in found.routes()[0].schedule() if s.is_client()]
    if sorted(cluster[order].tolist()) != list(range(1, int(cluster.max()) + 1)):
        return np.inf, []
    return sum(float(costs[a, b]) for a, b in itertools.pairwise((0, *order, 0))), order


def tree_tour(paths: FreePaths, lengths: Floats, cluster: Ints, tether: float) -> float:
    """Return the length of the shortest tour found along a tree of paths; infinite if there is none
    whose paths from the start are all within the tether.

    Parameters
    ----------
    tether : float
        Length of tether that is left at the start, metres.
    """
    best = np.inf
    for weight in (0.0, 0.2, 0.5, 1.0):
        tree = _tree(lengths, cluster, tether, weight)
        if tree is not None:
            best = min(best, _along_tree(paths, tree))
    return best


def _tree(
    lengths: Floats, cluster: Ints, tether: float, weight: float
) -> list[tuple[int, int]] | None:
    """Return the edges of a tree from the start, by growing it where an edge and a share of its
    distance from the start are shortest; None if the tether does not reach."""
    depth, edges, missing = {0: 0.0}, [], set(range(1, int(cluster.max()) + 1))
    while missing:
        options = [
            (lengths[u, v] + weight * d, u, v)
            for u, d in depth.items()
            for v in range(1, len(lengths))
            if int(cluster[v]) in missing and d + lengths[u, v] <= tether
        ]
        if not options:
            return None
        _, u, v = min(options)
        depth[v] = depth[u] + float(lengths[u, v])
        edges.append((u, v))
        missing.discard(int(cluster[v]))
    return edges


def _along_tree(paths: FreePaths, tree: list[tuple[int, int]]) -> float:
    """Return the length of a tour along a tree and back; infinite if a leg between two visits does
    not keep its room."""
    children: dict[int, list[int]] = {}
    for u, v in tree:
        children.setdefault(u, []).append(v)
    total, at, walked = 0.0, 0, []

    def visit(u: int) -> bool:
        nonlocal total, at, walked
        for v in children.get(u, ()):
            walked.append(paths.paths[u, v][0])
            if not all(keeps(paths.water, leg, float(paths.rooms[at, v])) for leg in walked):
                return False
            total += sum(length_of(leg) for leg in walked)
            at, walked = v, []
            if not visit(v):
                return False
            walked.append(paths.paths[v, u][0])
        return True

    if not visit(0):
        return np.inf
    home = all(keeps(paths.water, leg, float(paths.rooms[at, 0])) for leg in walked)
    return total + sum(length_of(leg) for leg in walked) if home else np.inf


@dataclass
class _Partial:
    """Tour in the making: legs so far, the tether, its word, and metres."""

    legs: list[tuple[int, Floats]]
    tether: Tether
    word: int
    length: float


def driven_tours(
    context: PlanningContext,
    paths: FreePaths,
    names: Sequence[tuple[int, int]],
    orders: Iterator[list[int]],
    is_over: Callable[[], bool],
    width: int = 2,
) -> Iterator[DrivenTour]:
    """Yield tours that bring the tether home free, driven leg by leg.

    Parameters
    ----------
    names : sequence of (int, int)
        Waypoint and alternative of each vertex.
    orders : iterator of list of int
        Orders of vertices to drive.
    is_over : callable
        Whether the time is up.
    width : int
        Number of partial tours kept after each leg.
    """
    mission, start = context.mission, context.start_tether
    first = context.word_number(start.nodes)
    for order in orders:
        if first is None or is_over():
            return
        kept = [_Partial([], start, first, 0.0)]
        for v in order:
            grown: list[_Partial] = []
            for part in kept:
                u = part.legs[-1][0] if part.legs else 0
                for path in _legs(paths, u, v):
                    if is_over():
                        return
                    word = context.word_number(path)
                    if word is None:
                        continue
                    tether, longest = context.drive(part.tether, path, is_fine=True)
                    if longest <= mission.tether_length:
                        grown.append(_Partial(
                            [*part.legs, (v, path)], tether,
                            context.words.multiply(part.word, word), part.length + length_of(path),
                        ))  # fmt: skip
            grown.sort(key=lambda p: p.length + 0.5 * p.tether.length)
            kept = grown[:width]
        for part in kept:
            last = part.legs[-1][0]
            legs = [LegTo(*names[v], path) for v, path in part.legs]
            for home in _legs(paths, last, 0):
                word = context.word_number(home)
                if word is None or context.words.multiply(part.word, word) != first:
                    continue
                driven = drive_legs(context, legs, home)
                if driven is not None:
                    yield driven
                    break


def _legs(paths: FreePaths, u: int, v: int) -> list[Floats]:
    """Return the paths from a vertex to another: direct ones, and by way of the start."""
    if u == v:
        return []
    found = list(paths.paths.get((u, v), []))
    if u != 0 and v != 0 and paths.paths.get((u, 0)) and paths.paths.get((0, v)):
        by_start = np.vstack([paths.paths[u, 0][0], paths.paths[0, v][0][1:]])
        if keeps(paths.water, by_start, float(paths.rooms[u, v])):
            found.append(by_start)
    return found


def judged(driven: DrivenTour, context: PlanningContext, scene: Scene) -> Mission | None:
    """Return the mission with a tour that was driven; None if the judge refuses it."""
    mission = context.mission
    tour = PlannedTour(
        stops=tuple(
            PlannedVisit(
                path=tuple(map(tuple, visit.path.tolist())), signature=visit.word,
                tether_length=visit.tether_length, longest_tether=visit.longest_tether,
                given_as=visit.waypoint,
            )
            for visit in driven.visits
        ),
        home=tuple(map(tuple, driven.home.tolist())),
        status=Status.FEASIBLE, solver="law", seed=0, length=driven.length, states=0, legs=0,
        exact=context.words.exact, unresolved_gaps=context.unresolved_gaps,
    )  # fmt: skip
    places = tuple(mission.waypoints[v.waypoint].at(v.choice) for v in driven.visits)
    planned = mission.model_copy(update={"waypoints": places, "tour": tour})
    return planned if verify_mission(planned, scene=scene, context=context) else None
