"""Other people's solvers on our travel graphs: (length, bound) of each, inf and 0 if it has none.

The exact ones get the raw model over all legs; the heuristics get the generalised TSP in the form
that they understand. Optional packages: `pip install -e ".[bench]"`; LKH, inside elkai, is free for
academic use only.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable

import numpy as np
from table import ROOT

from netsp import TravelGraph, solve_graph

Outcome = tuple[float, float]


def ours(solver: str) -> Callable[[TravelGraph, float], Outcome]:
    """One of ours by name."""

    def run(graph: TravelGraph, limit: float) -> Outcome:
        result = solve_graph(graph, solver, time_limit=limit)
        return result.length or np.inf, result.lower_bound or 0.0

    return run


def cp_sat(graph: TravelGraph, limit: float) -> Outcome:
    """CP-SAT, two workers: a circuit with optional vertices, exactly one of every cluster."""
    with tempfile.NamedTemporaryFile(suffix=".npz") as file:
        np.savez(file, costs=graph.costs, cluster=graph.cluster)
        file.flush()
        script = str(ROOT / "benchmarks" / "cp_sat.py")
        run = subprocess.run(
            [sys.executable, script, file.name, str(limit)], capture_output=True, text=True
        )
    if run.returncode:
        raise ImportError(run.stderr.strip().splitlines()[-1], name="ortools")
    length, bound = map(float, run.stdout.split())
    return length, bound


def raw(backend: str) -> Callable[[TravelGraph, float], Outcome]:
    """The paper's program over all legs, cut at integer solutions only."""

    def run(graph: TravelGraph, limit: float) -> Outcome:
        from netsp.mip.cbc_program import CbcInteger
        from netsp.mip.highs_integer import HighsInteger
        from netsp.mip.subtours import component_cuts

        legs = np.argwhere(np.triu(np.isfinite(graph.costs), 1))
        costs = graph.costs[legs[:, 0], legs[:, 1]]
        program = HighsInteger if backend == "highs" else CbcInteger
        model = program(graph.cluster, np.arange(len(graph)), legs, costs, [])
        begin, bound = time.perf_counter(), 0.0
        while (left := limit - (time.perf_counter() - begin)) > 0:
            outcome = model.solve(left)
            bound = max(bound, outcome.bound or 0.0)
            if outcome.point is None or not outcome.finished:
                break
            x, y = np.rint(outcome.point.x), np.rint(outcome.point.y)
            cuts = component_cuts(x, outcome.point.legs, y, graph.cluster)
            if not cuts:
                return outcome.point.objective, bound
            model.add_cuts(cuts)
        return np.inf, bound

    return run


def lkh(graph: TravelGraph, limit: float) -> Outcome:
    """LKH 3 (through elkai, one run, no time limit) after Noon & Bean (1993): the vertices of a
    cluster form a cycle of free arcs, and an arc that leaves a cluster leaves from the vertex
    before its own, so that an optimal tour enters a cluster, goes once round and pays as if it had
    left from where it entered."""
    import elkai

    costs, cluster = graph.costs, graph.cluster
    scale = 1e5 / float(np.max(costs[np.isfinite(costs)]))
    n = len(costs)
    whole = np.where(np.isfinite(costs), np.rint(costs * scale), 2e5).astype(np.int64)
    most = int(whole.max()) + 1
    asymmetric = np.zeros((n, n), dtype=np.int64)
    following = np.arange(n)
    for c in range(graph.goal_count + 1):
        members = graph.members(c)
        following[members] = np.roll(members, -1)
    asymmetric[:] = whole[following] + most
    asymmetric[cluster[:, None] == cluster[None, :]] = 4 * most
    asymmetric[np.arange(n), following] = 0
    order = elkai.DistanceMatrix(asymmetric.tolist()).solve_tsp(runs=1)[:-1]
    at = np.roll(order, -order.index(0))
    entered = [int(v) for k, v in enumerate(at) if cluster[v] != cluster[at[k - 1]]]
    if sorted(cluster[entered].tolist()) != list(range(graph.goal_count + 1)):
        return np.inf, 0.0
    return graph.tour_length(entered), 0.0


def pyvrp(graph: TravelGraph, limit: float) -> Outcome:
    """PyVRP, one vehicle, a mutually exclusive group of clients for every cluster."""
    from pyvrp import Model
    from pyvrp.stop import MaxRuntime

    costs, cluster = graph.costs, graph.cluster
    scale = 1e5 / float(np.max(costs[np.isfinite(costs)]))
    model = Model()
    places = [model.add_location(v, 0) for v in range(len(costs))]
    model.add_depot(places[0])
    model.add_vehicle_type(1)
    groups = [None, *(model.add_client_group() for _ in range(graph.goal_count))]
    for v in range(1, len(costs)):
        model.add_client(places[v], group=groups[cluster[v]], required=False)
    for u, v in np.argwhere(np.isfinite(costs)).tolist():
        model.add_edge(places[u], places[v], distance=round(float(costs[u, v]) * scale))
    found = model.solve(stop=MaxRuntime(limit), display=False, seed=0).best
    if not found.is_feasible():
        return np.inf, 0.0
    stops = found.routes()[0].schedule()
    tour = [0, *(s.idx + 1 for s in stops if s.is_client())]
    if sorted(cluster[tour].tolist()) != list(range(graph.goal_count + 1)):
        return np.inf, 0.0
    return graph.tour_length(tour), 0.0


EXACT: dict[str, Callable[[TravelGraph, float], Outcome]] = {
    "netsp auto": ours("auto"),
    "netsp mip": ours("mip"),
    "CP-SAT": cp_sat,
    "HiGHS, raw model": raw("highs"),
    "CBC, raw model": raw("cbc"),
}

HEURISTIC: dict[str, Callable[[TravelGraph, float], Outcome]] = {
    "netsp lns": ours("lns"),
    "LKH, Noon-Bean": lkh,
    "PyVRP, groups": pyvrp,
}
