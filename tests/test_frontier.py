"""What makes long proofs possible: bounds among slits, cuts, elimination, lns and auto."""

import itertools
import math

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import NetspError, Polygon, Problem, Status, solve, solve_graph, travel_graph, verify
from netsp.base.clock import Clock
from netsp.base.errors import MemoryLimitError
from netsp.gtsp.gtsp_policy import CostPolicy, GtspPolicy
from netsp.gtsp.limits import Limits
from netsp.gtsp.search import LayeredInstance, Search
from netsp.mip.flows import Edges, min_cuts
from netsp.mip.mip_policy import MipPolicy
from netsp.mip.mip_solver import MipRun
from netsp.mip.subtours import label_families
from netsp.plan.solve_policy import RoutePolicy, SolvePolicy, SubsetPolicy
from netsp.roadmap.slits import _taut_string, build_slits, slit_lengths
from netsp.roadmap.taut import TautRoadmap
from tests.brute import brute_tour
from tests.travel_graphs import bound_legs_first, random_graph
from tests.worlds import random_world, small_worlds


@settings(max_examples=40, deadline=None)
@given(small_worlds(), st.booleans())
def test_among_slits_no_leg_is_longer(problem, grid):
    try:
        graph = travel_graph(problem)
    except NetspError:  # a goal out of reach
        return
    exact, low = graph.costs, graph.lower_bounds()
    held = np.isfinite(exact)
    assert (low[held] <= exact[held] * (1 + 1e-12)).all()
    assert (low[0, 1:] >= exact[0, 1:] * 0.3).all()


@settings(max_examples=20, deadline=None)
@given(small_worlds(grid=True))
def test_among_slits_no_leg_is_longer_on_a_grid_of_ties(problem):
    try:
        graph = travel_graph(problem)
    except NetspError:  # a goal out of reach
        return
    exact, low = graph.costs, graph.lower_bounds()
    held = np.isfinite(exact)
    assert (low[held] <= exact[held] * (1 + 1e-12)).all()


@pytest.mark.parametrize("seed", range(4))
def test_for_obstacles_that_are_slits_the_bound_is_the_length(seed):
    rng = np.random.default_rng(seed)
    x = np.sort(rng.uniform(1, 9, 5))
    thin = 1e-6
    slits = []
    for k in x:
        y, h = rng.uniform(-2, 2), rng.uniform(0.5, 2)
        slits.append(
            Polygon(polygon=[(k, y - h), (k + thin, y - h), (k + thin, y + h), (k, y + h)])
        )
    p = Problem(
        base=(0, 0), goals=[(10, 0.3), (float(x[2] + x[3]) / 2, 0.1)], obstacles=slits,
        tether_length=18,
    )  # fmt: skip
    roadmap = TautRoadmap(p)
    graph = roadmap.to_travel_graph()
    low = slit_lengths(build_slits(p), roadmap.outline.places, roadmap.cluster, roadmap.signatures)
    held = np.isfinite(graph.costs)
    assert len(graph) > 6
    assert np.abs(low[held] - graph.costs[held]).max() < 1e-3


@settings(max_examples=80, deadline=None)
@given(
    st.lists(
        st.tuples(st.floats(0, 2), st.floats(-3, 3), st.booleans(), st.floats(0, 2)),
        min_size=1, max_size=6,
    ),
    st.floats(-3, 3),
)  # fmt: skip
def test_the_taut_string_is_the_least_of_a_convex_program(gates, start):
    """Against alternating minimisation from three starts: no string through the gates is shorter,
    and some string is as short."""
    s = np.cumsum([round(g[0], 2) for g in gates])
    rows = np.array(
        [(a, g[1], np.inf) if g[2] else (a, -np.inf, g[1]) for a, g in zip(s, gates, strict=True)]
    )
    rows[-1, 1:] = gates[-1][1]
    corner = np.empty((len(rows), 2), dtype=np.int64)
    length, _ = _taut_string(start, np.column_stack([rows, rows]), len(rows), corner)
    xs = np.concatenate([[0.0], rows[:, 0]])
    best = math.inf
    for first in (-3.0, 0.0, 3.0):
        y = np.concatenate([[start], np.clip(first, rows[:, 1], rows[:, 2])])
        for _ in range(400):
            for k in range(1, len(y) - 1):
                left, right = xs[k] - xs[k - 1], xs[k + 1] - xs[k]
                t = left / (left + right) if left + right > 0 else 0.5
                y[k] = np.clip(y[k - 1] + t * (y[k + 1] - y[k - 1]), *rows[k - 1, 1:])
        best = min(best, float(np.hypot(np.diff(xs), np.diff(y)).sum()))
    assert length <= best + 1e-9
    assert length >= math.hypot(xs[-1], rows[-1, 1] - start) - 1e-9
    if (np.diff(xs) > 0.01).all():
        assert length >= best - 0.05 * (1 + best)


@pytest.mark.parametrize("seed", range(20))
def test_minimum_cuts_are_those_of_networkx(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 12))
    pairs = [e for e in itertools.combinations(range(n), 2) if rng.random() < 0.5]
    tail, head = (np.array([e[k] for e in pairs], dtype=np.int64) for k in range(2))
    capacity = rng.uniform(0.1, 1.0, len(pairs))
    cluster = np.concatenate([[0], rng.integers(1, 3, n - 1)])
    for c in np.unique(cluster[1:]):
        edges = Edges(tail, head, capacity)
        sets, _, values = min_cuts(n, edges, cluster, 0, np.array([c]), 1e9)
        g = nx.Graph()
        g.add_nodes_from([*range(n), "s"])
        for (u, v), w in zip(pairs, capacity, strict=True):
            g.add_edge(u, v, capacity=w)
        for v in np.flatnonzero(cluster == c):
            g.add_edge("s", int(v))  # without limit
        expected = nx.maximum_flow_value(g, "s", 0)
        assert values[0] == pytest.approx(expected)
        inside = sets[0]
        assert not inside[0]
        assert inside[cluster == c].all()
        assert capacity[inside[tail] ^ inside[head]].sum() == pytest.approx(expected)


@pytest.mark.parametrize("seed", range(60))
def test_the_clusters_with_a_cut_below_enough_are_those_of_networkx(seed):
    """Whatever was found to have none counts as the sink for those after it; of clusters that no
    set is cut more for having together, one is asked for."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(6, 14))
    pairs = [e for e in itertools.combinations(range(n), 2) if rng.random() < 0.4]
    tail, head = (np.array([e[k] for e in pairs], dtype=np.int64) for k in range(2))
    capacity = rng.uniform(0.1, 1.0, len(pairs))
    cluster = np.concatenate([[0], rng.integers(1, n, n - 1)])  # most of one vertex, some of more
    wanted = rng.permutation(np.unique(cluster[1:]))
    flows = {}
    for c in wanted.tolist():
        g = nx.Graph()
        g.add_nodes_from([*range(n), "s"])
        for (u, v), w in zip(pairs, capacity, strict=True):
            g.add_edge(u, v, capacity=w)
        for v in np.flatnonzero(cluster == c):
            g.add_edge("s", int(v))
        flows[c] = nx.maximum_flow_value(g, "s", 0)
    enough = float(np.median(list(flows.values()))) + 1e-6
    sets, which, values = min_cuts(n, Edges(tail, head, capacity), cluster, 0, wanted, enough)
    below = {c for c, flow in flows.items() if flow < enough}
    assert set(which.tolist()) <= below
    for c in below:
        with_it = [v for s, v in zip(sets, values, strict=True) if s[cluster == c].all()]
        assert min(with_it) == pytest.approx(flows[c])
    for inside, c, value in zip(sets, which.tolist(), values, strict=True):
        assert value == pytest.approx(flows[c])
        assert capacity[inside[tail] ^ inside[head]].sum() == pytest.approx(value)
        assert inside[cluster == c].all()
        assert not inside[0]


def test_branches_are_the_prefixes_of_words():
    words = [(), (1,), (1, 2), (1, 2, 3), (-1,), (-1, 2)]
    found = {tuple(np.flatnonzero(row).tolist()) for row in label_families(words)}
    assert found == {(1, 2, 3), (2, 3), (4, 5)}


@pytest.mark.parametrize("seed", range(8))
def test_nothing_that_is_ruled_out_is_in_the_optimum(seed):
    """Elimination with a weak incumbent keeps an optimal tour."""
    graph = random_graph(seed, goals=6)
    best = brute_tour(graph)
    run = MipRun(graph, Limits(rng=np.random.default_rng(seed)), search_rounds=0)
    result = run.solve("highs", None)
    assert result.status is Status.OPTIMAL
    assert result.length == pytest.approx(best, rel=1e-6)
    assert result.lower_bound <= best * (1 + 1e-12)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000), st.integers(2, 7))
def test_the_search_keeps_its_length_and_never_beats_brute_force(seed, goals):
    graph = random_graph(seed, goals=goals)
    search = Search(LayeredInstance.of_graph(graph), np.random.default_rng(seed))
    search.settle()
    settled = search.best_length
    search.run(50, Clock(None))
    length, tour = search.best()
    assert graph.is_tour(tour)
    assert length == pytest.approx(graph.tour_length(tour))
    assert length == pytest.approx(search.best_length)
    assert brute_tour(graph) * (1 - 1e-9) <= length <= settled * (1 + 1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_lns_finds_the_proven_optimum_of_twenty_goals(seed):
    problem = random_world(seed, goals=20, tether=300.0)
    best = solve(problem, "mip")
    found = solve(problem, "lns", iteration_limit=4_000)
    assert verify(problem, found)
    assert found.lower_bound is None
    assert best.length * (1 - 1e-6) <= found.length <= best.length * 1.01


def test_auto_proves_what_it_can():
    problem = random_world(1, goals=12, tether=300.0)
    solution = solve(problem)
    assert solution.solver == "auto"
    assert solution.status is Status.OPTIMAL
    assert verify(problem, solution)


NO_SUBSETS = SubsetPolicy(max_sums=0)


def test_auto_gives_a_tour_and_a_true_bound_where_mip_would_not_fit():
    problem = random_world(1, goals=8, tether=300.0)
    best = solve(problem, "mip")
    routes = RoutePolicy(max_proven_vertices=10, max_walk_goals=4)
    params = {"policy": SolvePolicy(routes=routes, subsets=NO_SUBSETS)}
    solution = solve(problem, "auto", iteration_limit=2_000, params=params)
    assert verify(problem, solution)
    assert solution.lower_bound is not None
    assert 0.3 * best.length < solution.lower_bound <= best.length * (1 + 1e-9)
    assert solution.length >= best.length * (1 - 1e-6)


def test_auto_gives_a_tour_and_a_true_bound_where_there_is_no_room_for_the_legs(monkeypatch):
    problem = random_world(1, goals=8, tether=300.0)
    best = solve(problem, "mip")

    def none_left(size, what, advice):
        if size > 24.0 * 9**2:  # there is for the legs between the goals
            raise MemoryLimitError(f"{what} would take {size} bytes; {advice}")

    mip = MipPolicy(gtsp=GtspPolicy(costs=CostPolicy(max_measured_vertices=0)))
    monkeypatch.setattr("netsp.gtsp.cost_matrix.check_available", none_left)
    with pytest.raises(MemoryLimitError, match="bounding every tour over"):
        solve(problem, "mip", params={"policy": mip})
    policy = SolvePolicy(subsets=NO_SUBSETS, mip=mip)
    solution = solve(problem, "auto", params={"policy": policy})
    assert verify(problem, solution)
    assert 0.3 * best.length < solution.lower_bound <= best.length * (1 + 1e-9)
    assert solution.length >= best.length * (1 - 1e-6)


@pytest.mark.parametrize("kept", [16, 40, 4000])
def test_few_goals_are_proven_over_the_shortest_classes(kept):
    """The status claims no more than was looked at, the bound holds for all."""
    problem = random_world(1, goals=8, tether=300.0)
    best = solve(problem, "mip")
    routes = RoutePolicy(max_proven_vertices=10, kept_vertices=kept)
    params = {"policy": SolvePolicy(routes=routes, subsets=NO_SUBSETS)}
    solution = solve(problem, "auto", params=params)
    assert verify(problem, solution)
    assert solution.lower_bound is not None
    assert 0.0 < solution.lower_bound <= best.length * (1 + 1e-9)
    assert solution.length >= best.length * (1 - 1e-6)
    if solution.status is Status.OPTIMAL:
        assert solution.length == pytest.approx(best.length, rel=1e-6)
    else:
        assert solution.status is Status.OPTIMAL_OF_KEPT
    assert (solution.status is Status.OPTIMAL) == (kept == 4000)


@pytest.mark.parametrize("seed", range(6))
def test_sets_of_goals_and_cutting_planes_agree(seed):
    from netsp.plan import exact

    graph = travel_graph(random_world(seed, goals=7, tether=280.0))
    assert exact.fits(graph)
    small, cut = solve_graph(graph, "auto"), solve_graph(graph, "mip")
    assert small.status is cut.status is Status.OPTIMAL
    assert small.length == pytest.approx(cut.length, rel=2e-6)
    assert graph.tour_length(small.tour) == pytest.approx(small.length)


def test_the_root_reports_what_is_left():
    rows = []
    graph = travel_graph(random_world(0, goals=15, tether=300.0))
    result = solve_graph(graph, "mip", on_progress=rows.append)
    assert result.status is Status.OPTIMAL
    left = [r.legs for r in rows if r.stage == "root"]
    assert left == sorted(left, reverse=True)
    assert left[0] > 0
    assert all(0 < r.vertices <= len(graph) for r in rows if r.stage == "root")


@pytest.mark.parametrize("solver", ["auto", "mip"])
def test_a_limit_that_ends_in_the_root_leaves_a_true_bound(solver):
    graph = travel_graph(random_world(3, goals=25, tether=300.0))
    best = solve_graph(graph, "mip").length
    for limit in (3, 8, 20):
        result = solve_graph(graph, solver, iteration_limit=limit)
        assert result.lower_bound <= best * (1 + 1e-9)
        assert result.length >= best * (1 - 1e-6)


def test_auto_bounds_large_graphs_without_geometry_too():
    graph = random_graph(4, goals=6)
    best = brute_tour(graph)
    routes = RoutePolicy(max_proven_vertices=5)
    params = {"policy": SolvePolicy(routes=routes, subsets=NO_SUBSETS)}
    result = solve_graph(graph, "auto", iteration_limit=500, params=params)
    assert 0.0 < result.lower_bound <= best * (1 + 1e-9)
    assert result.length >= best * (1 - 1e-9)


def core_first(problem, share=0.4, **limits):
    """A proof over the core, then over all, of a world so small that the core would not be worth
    it."""
    core = {"min_core_ratio": 1.0, "max_core_per_cluster": 3, "core_vertices": 1,
            "core_time_share": share}  # fmt: skip
    policy = {"gtsp": {"costs.max_measured_vertices": 0, "proof_search": core}}
    return solve_graph(travel_graph(problem), "mip", seed=0, params={"policy": policy}, **limits)


@pytest.mark.parametrize("at_once", [True, False])
@pytest.mark.parametrize("seed", range(4))
def test_a_proof_over_the_core_first_ends_at_the_same_optimum(monkeypatch, seed, at_once):
    problem = random_world(seed, goals=7, tether=300.0)
    best = solve(problem, "mip", seed=0).length
    if not at_once:
        bound_legs_first(monkeypatch)
    run = core_first(problem)
    assert any(row.stage == "core" for row in run.trace)
    goals = next(row for row in run.trace if row.stage == "goals")
    assert 0.3 * best < goals.bound.length <= best * (1 + 1e-9)
    assert run.status is Status.OPTIMAL
    assert run.length == pytest.approx(best, rel=1e-6)
    assert all(row.bound is None or row.bound.length <= best * (1 + 1e-6) for row in run.trace)


@pytest.mark.parametrize("iterations", [1, 3, 6, 12, 25])
def test_a_core_that_is_cut_short_claims_nothing(monkeypatch, iterations):
    problem = random_world(1, goals=7, tether=300.0)
    best = solve(problem, "mip", seed=0).length
    run = core_first(problem, iteration_limit=iterations)
    assert (run.lower_bound or 0.0) <= best * (1 + 1e-6)
    assert run.status is not Status.INFEASIBLE
    if run.length is not None:
        assert run.length >= best * (1 - 1e-6)


def test_a_core_whose_time_is_over_hands_over_to_the_proof_over_all(monkeypatch):
    problem = random_world(1, goals=7, tether=300.0)
    best = solve(problem, "mip", seed=0).length
    run = core_first(problem, share=1e-4, time_limit=100.0)
    assert run.status is Status.OPTIMAL
    assert run.length == pytest.approx(best, rel=1e-6)


@settings(max_examples=30, deadline=None)
@given(small_worlds(), st.sampled_from(["taut", "prm"]))
def test_no_leg_is_shorter_than_the_way_between_its_goals_in_any_class(problem, roadmap):
    options = {"samples": 100, "seed": 0} if roadmap == "prm" else {}
    try:
        graph = travel_graph(problem, roadmap, **options)
    except NetspError:  # a goal out of reach
        return
    least = graph.distances_between_goals()
    for a, b in itertools.combinations(range(graph.goal_count + 1), 2):
        legs = graph.costs[np.ix_(graph.members(a), graph.members(b))]
        assert least[a, b] <= legs.min() * (1 + 1e-9)
        straight = math.dist(problem.points[a], problem.points[b])
        assert least[a, b] >= straight * (1 - 1e-6)


def test_what_was_not_looked_at_in_time_bounds_nothing():
    graph = travel_graph(random_world(0, goals=20, tether=300.0))
    looked = iter([False, True])
    part, whole = (
        graph.distances_between_goals(lambda: next(looked)),
        graph.distances_between_goals(),
    )
    assert (part <= whole).all()
    assert 0 < (part == 0.0).sum() < part.size
