"""What every registered solver promises, on both roadmaps and on graphs without geometry."""

import functools
import itertools
import math
import time

import numpy as np
import psutil
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import InputError, Problem, Status, TravelGraph, solve, solve_graph, verify
from netsp.plan.solve_problem import travel_graph
from netsp.plan.solver_table import ROADMAPS, SOLVERS
from tests.brute import brute_tour
from tests.travel_graphs import random_graph
from tests.worlds import random_world

BLIND = {s.name for s in SOLVERS.values() if s.blind}
GEOMETRIC = {s.name for s in SOLVERS.values() if s.geometric}

SEEING = [s for s in SOLVERS if s not in BLIND]
ANYWHERE = [s for s in SOLVERS if s not in GEOMETRIC]
ITERATIONS = {"anneal": 20_000, "anneal-2016": 5_000, "lns": 500}
SEED = 3
EXACT = 1.0 + 1e-6


@functools.cache
def world():
    return random_world(5, circles=10, goals=6, tether=280.0)


@functools.cache
def graph(roadmap):
    return travel_graph(world(), roadmap, **({"seed": SEED} if roadmap == "prm" else {}))


PROVEN = {"taut": Status.OPTIMAL, "prm": Status.OPTIMAL_OF_ROADMAP}
"""Status of a shortest tour, by roadmap: a sampled one holds not all tours."""


@functools.cache
def optimum(roadmap):
    result = solve_graph(graph(roadmap), "mip")
    assert result.status is PROVEN[roadmap]
    return result


@pytest.mark.parametrize("roadmap", ROADMAPS)
@pytest.mark.parametrize("solver", SOLVERS)
def test_a_solution_is_verified_or_honestly_none_and_never_beats_the_optimum(solver, roadmap):
    solution = solve(
        world(), solver, roadmap=roadmap, iteration_limit=ITERATIONS.get(solver), seed=SEED
    )
    if solution.status is Status.NO_SOLUTION_FOUND:
        assert solution.length is None
        return
    assert solution.path[0] == solution.path[-1] == world().base
    if solution.status is Status.INVALID:
        assert solver in BLIND
        verdict = verify(world(), solution)
        failed = {c.name for c in verdict.checks if not c.passed}
        assert failed
        assert failed <= {"total word is empty", "contractible over triangles", "taut tether fits"}
        return
    assert verify(world(), solution)
    best = optimum(roadmap).length
    assert solution.length >= best / EXACT
    assert solution.lower_bound is None or solution.lower_bound <= best * EXACT
    if solution.status is Status.OPTIMAL:
        assert solution.length <= best * EXACT


@pytest.mark.parametrize("solver", ANYWHERE)
@pytest.mark.parametrize("seed", range(5))
def test_on_any_generalised_tsp_no_solver_beats_brute_force(solver, seed):
    g = random_graph(seed, goals=3 + seed % 4)
    best = brute_tour(g)
    result = solve_graph(g, solver, iteration_limit=ITERATIONS.get(solver))
    assert g.is_tour(result.tour)
    walk = result.walk or (*result.tour, 0)
    assert set(result.tour) <= set(walk)
    assert walk[0] == walk[-1] == 0
    assert result.length == pytest.approx(g.walk_length(walk))
    assert result.length >= best * (1 - 1e-9)
    assert result.lower_bound is None or result.lower_bound <= best * (1 + 1e-9)


@pytest.mark.parametrize("solver", SOLVERS)
def test_same_seed_same_answer(solver):
    def run():
        limit = ITERATIONS.get(solver, 3)
        r = solve_graph(graph("taut"), solver, iteration_limit=limit, seed=7)
        return r.tour, r.length, r.lower_bound, r.status, r.walk

    assert run() == run()


@pytest.mark.parametrize("solver", SOLVERS)
def test_the_time_limit_is_kept_and_leaves_no_process(solver):
    params = {"backend": "cbc"} if solver in ("auto", "mip", "reduced-mip") else None
    begin = time.monotonic()
    result = solve_graph(graph("taut"), solver, time_limit=0.3, params=params)
    assert time.monotonic() - begin < 0.3 + 2.0
    assert result.tour is None or graph("taut").is_tour(result.tour)
    assert [p for p in psutil.Process().children(recursive=True) if "cbc" in p.name()] == []


@pytest.mark.parametrize("solver", SOLVERS)
def test_one_iteration_is_enough_to_end_honestly(solver):
    result = solve_graph(graph("taut"), solver, iteration_limit=1)
    assert all(row.iteration <= 1 for row in result.trace)
    if result.tour is not None:
        assert result.length >= optimum("taut").length / EXACT
    if result.status is Status.OPTIMAL:
        assert result.length <= optimum("taut").length * EXACT


@pytest.mark.parametrize("solver", SOLVERS)
def test_ctrl_c_gives_what_there_is(solver):
    interrupted = []

    def interrupt(row):
        if not interrupted:
            interrupted.append(row)
            raise KeyboardInterrupt

    result = solve_graph(graph("taut"), solver, on_progress=interrupt)
    assert interrupted
    assert result.tour is None or graph("taut").is_tour(result.tour)
    assert result.status is not Status.INFEASIBLE


@pytest.mark.parametrize("solver", SOLVERS)
def test_ctrl_c_at_any_report_gives_what_there_is(solver):
    limit = ITERATIONS.get(solver)
    reports = len(solve_graph(graph("taut"), solver, iteration_limit=limit).trace)
    for at in sorted({1, 2, reports // 2, reports - 1, reports}):
        seen = []

        def interrupt(row, seen=seen, at=at):
            seen.append(row)
            if len(seen) == at:
                raise KeyboardInterrupt

        result = solve_graph(graph("taut"), solver, iteration_limit=limit, on_progress=interrupt)
        assert result.tour is None or graph("taut").is_tour(result.tour)


@pytest.mark.parametrize("solver", ["anneal", "anneal-2016", "lns"])
def test_of_two_limits_the_first_to_come_ends_the_run(solver):
    begin = time.monotonic()
    result = solve_graph(graph("taut"), solver, time_limit=0.4, iteration_limit=10**15)
    assert time.monotonic() - begin < 3.0
    assert result.length <= optimum("taut").length * 1.3


@pytest.mark.parametrize("scale", [1e-12, 1e-3, 1e10, 1e20])
@pytest.mark.parametrize("backend", ["highs", "cbc"])
def test_proofs_do_not_depend_on_the_unit(scale, backend):
    plain = random_graph(4, goals=6)
    costs = np.where(np.isfinite(plain.costs), plain.costs, 0.0) * scale
    g = TravelGraph.from_costs(costs, plain.cluster)
    result = solve_graph(g, "mip", params={"backend": backend})
    assert result.status is Status.OPTIMAL
    assert result.length == pytest.approx(brute_tour(plain) * scale, rel=1e-6)


def test_time_up_does_not_lose_a_tour():
    problem = random_world(1, goals=15, tether=350.0)
    for solver in ("reduced-mip", "mip", "auto"):
        for limit in (0.15, 0.4):
            warm = solve(problem, "greedy-2016")
            solution = solve(problem, solver, time_limit=limit, warm_start=warm)
            assert solution.length <= warm.length
            assert verify(problem, solution)


@pytest.mark.parametrize("solver", SEEING)
@pytest.mark.parametrize("first", ["greedy", "anneal", "mip"])
def test_a_warm_start_by_any_other_solver_is_never_made_worse(solver, first):
    p = world()
    warm = solve(p, first, iteration_limit=ITERATIONS.get(first))
    limit = ITERATIONS.get(solver, 1)
    again = solve(p, solver, warm_start=warm, iteration_limit=limit)
    assert again.length <= warm.length * (1 + 1e-12)
    assert verify(p, again)


def test_a_warm_start_from_another_roadmap_keeps_its_order():
    p = world()
    warm = solve(p, "mip", roadmap="taut")
    short = solve(p, "greedy", roadmap="prm", warm_start=warm)
    order = [v.goal for v in warm.tour]
    assert [v.goal for v in short.tour] in (order, order[::-1])


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("roadmap", ROADMAPS)
@pytest.mark.parametrize("goals", [1, 2])
def test_one_goal_and_two_goal_problems(solver, roadmap, goals):
    full = world()
    p = Problem(
        base=full.base,
        goals=full.goals[:goals],
        obstacles=full.obstacles,
        tether_length=full.tether_length,
    )
    solution = solve(p, solver, roadmap=roadmap, iteration_limit=ITERATIONS.get(solver))
    assert verify(p, solution) or (solver in BLIND and solution.status is Status.INVALID)
    if goals < 2:
        assert solution.status is PROVEN[roadmap]


@pytest.mark.parametrize("solver", SOLVERS)
def test_without_goals_the_tour_stays_at_the_base(solver):
    result = solve_graph(TravelGraph.from_costs([[0]], [0]), solver)
    assert (result.tour, result.length, result.status) == ((0,), 0.0, Status.OPTIMAL)


def dead_end():
    """Nearest neighbour runs from 1 to 2 to 3, whence there is no leg to 4."""
    far = math.inf
    costs = [
        [0, 1, 9, 9, 9],
        [1, 0, 1, 9, 9],
        [9, 1, 0, 1, 9],
        [9, 9, 1, 0, far],
        [9, 9, 9, far, 0],
    ]
    return TravelGraph.from_costs(costs, range(5))


def test_where_greedy_runs_into_a_dead_end_the_others_find_the_tour():
    g = dead_end()
    assert solve_graph(g, "greedy").status is Status.NO_SOLUTION_FOUND
    best = solve_graph(g, "mip")
    assert best.status is Status.OPTIMAL
    assert best.length == pytest.approx(brute_tour(g))
    assert solve_graph(g, "anneal", iteration_limit=20_000).length == pytest.approx(best.length)


@pytest.mark.parametrize("backend", ["highs", "cbc"])
def test_that_there_is_no_tour_is_proven_by_mip_and_claimed_by_none_else(backend):
    costs = np.full((5, 5), np.inf)
    costs[0, 1:] = costs[1:, 0] = 1.0  # a star: connected, yet no tour
    g = TravelGraph.from_costs(costs, range(5))
    assert solve_graph(g, "mip", params={"backend": backend}).status is Status.INFEASIBLE
    for solver in ("anneal", "lns", "greedy", "greedy-2016"):
        result = solve_graph(g, solver, iteration_limit=1000)
        assert result.status is Status.NO_SOLUTION_FOUND


@pytest.mark.parametrize(
    ("kwargs", "said"),
    [
        (
            {"solver": "gurobi"},
            "solver: unknown 'gurobi'; expected one of auto, mip, dp, reduced-mip",
        ),
        (
            {"solver": "mip", "params": {"hot": 1}},
            "unknown option 'hot'; expected one of backend, policy, search_rounds",
        ),
        ({"params": {"backend": "cplex"}}, "unknown 'cplex'; expected one of highs, cbc"),
        (
            {"solver": "mip", "params": {"search_rounds": "many"}},
            "expected a whole number, got 'many'",
        ),
        ({"solver": "greedy-tsp", "params": {"k": 1}}, "unknown option 'k'; it takes none"),
        (
            {"solver": "greedy-2016", "params": {"k": 1}},
            "unknown option 'k'; expected one of policy, retrace",
        ),
        (
            {"solver": "greedy-2016", "params": {"retrace": "tether"}},
            "option 'retrace': expected goal or end, got 'tether'",
        ),
        (
            {"solver": "mip-2017", "params": {"cuts": "all"}},
            "option 'cuts': expected goals or vertices, got 'all'",
        ),
        ({"solver": "anneal", "params": {"hot": 1, "cold": 2}}, "expected 0 < cold <= hot"),
        ({"solver": "anneal", "params": {"hot": math.nan}}, "expected a finite number"),
        ({"time_limit": 0.0}, "time_limit: expected a positive"),
        ({"time_limit": math.nan}, "time_limit: expected a positive"),
        ({"iteration_limit": 0}, "iteration_limit: expected a whole number from 1 on"),
        ({"warm_start": [0, 1]}, "warm_start: expected vertices from 0 on"),
        ({"warm_start": [0, 1.5, 2, 3, 4]}, "warm_start: expected vertices from 0 on"),
        ({"warm_start": "01234"}, "warm_start: expected vertices from 0 on"),
        ({"warm_start": 5}, "warm_start: expected vertices from 0 on"),
        ({"time_limit": "5"}, "time_limit: expected a positive"),
        ({"iteration_limit": 2.5}, "iteration_limit: expected a whole number"),
        ({"iteration_limit": True}, "iteration_limit: expected a whole number"),
        ({"seed": -1}, "seed: expected a whole number from 0 to"),
        ({"seed": 10**400}, "seed: expected a whole number from 0 to"),
        ({"params": [("backend", "highs")]}, "params: expected names with values"),
        ({"solver": ["mip"]}, "solver: unknown ['mip']"),
        ({"solver": "greedy-tsp"}, "needs the geometry"),
        ({"solver": "anneal-2016"}, "needs the geometry"),
    ],
)
def test_bad_calls_are_told_in_one_line(kwargs, said):
    with pytest.raises(InputError) as error:
        solve_graph(dead_end(), **kwargs)
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def good_costs():
    c = np.abs(np.subtract.outer(np.arange(4.0), np.arange(4.0)))
    return c, np.array([0, 1, 2, 2])


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            lambda c, k: (c + np.triu(np.ones((4, 4)), 1), k),
            "costs[0][1] is 2 and costs[1][0] is 1",
        ),
        (lambda c, k: (-c, k), "costs[0][1] is -1; expected no negative cost"),
        (lambda c, k: (c * np.nan, k), "costs[0][1] is not a number"),
        (lambda c, k: (c[:3], k), "expected a square matrix, got shape (3, 4)"),
        (lambda c, k: (c, k[:3]), "expected 4 numbers"),
        (lambda c, k: (c, np.where(k > 0, k + 1, 0)), "cluster 1 has no vertex"),
        (lambda c, k: (c, k * 1e9), "4 vertices cannot fill clusters 0 to 2e+09"),
        (lambda c, k: (c, [0, 1, 2, np.inf]), "expected whole numbers from 0 on"),
        (lambda c, k: (c * 1e300, k), "is too large"),
        (lambda c, k: (None, k), "expected a square matrix"),
        (lambda c, k: ([[10**400]], k), "expected numbers"),
        (lambda c, k: (c, k - 1), "expected whole numbers from 0 on, got -1"),
        (lambda c, k: (c, [0, 1, 2, 0.5]), "expected whole numbers from 0 on, got 0.5"),
        (lambda c, k: (c, [0, 0, 1, 1]), "vertex 0, where the tour starts, must be alone"),
        (lambda c, k: (np.where(np.eye(4)[1] + np.eye(4)[:, [1]], np.inf, c), k), "cluster 1 off"),
        (lambda c, k: ([["a"]], [0]), "expected numbers"),
    ],
)
def test_costs_that_make_no_travel_graph_are_told_in_one_line(change, said):
    with pytest.raises(InputError) as error:
        TravelGraph.from_costs(*change(*good_costs()))
    assert said in str(error.value)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000), st.permutations(range(1, 5)))
def test_renaming_clusters_does_not_change_the_optimum(seed, names):
    g = random_graph(seed, goals=4, most=3)
    costs = np.where(np.isfinite(g.costs), g.costs, 0.0)
    renamed = TravelGraph.from_costs(costs, np.array([0, *names])[g.cluster])
    assert solve_graph(renamed).length == pytest.approx(solve_graph(g).length, rel=2e-6)


def test_the_library_example_of_a_subgraph_keeps_costs_and_paths():
    g = travel_graph(world(), "taut")
    some = np.flatnonzero(np.arange(len(g)) % 3 != 1)
    some = np.unique(np.concatenate([[0], some]))
    # among some vertices other legs may be pulled, of which the others are sums
    before = g.subgraph(some).costs
    assert np.allclose(before, g.costs[np.ix_(some, some)], rtol=1e-12)
    part = g.subgraph(some)
    assert np.array_equal(part.costs, g.costs[np.ix_(some, some)])
    assert np.array_equal(part.costs_to_base[1:], g.costs_to_base[some][1:])
    for u, v in itertools.pairwise(range(0, len(part), max(1, len(part) // 4))):
        if part.cluster[u] != part.cluster[v]:
            assert np.array_equal(part.path(u, v), g.path(int(some[u]), int(some[v])))


@pytest.mark.parametrize("solver", ["auto", "lns", "mip", "dp"])
def test_a_graph_without_a_class_of_some_goal_is_refused(solver):
    g = random_graph(0, goals=12, most=3)
    part = g.subgraph(np.flatnonzero(g.cluster != 5))
    with pytest.raises(InputError, match="no class of goal 5; expected one of every goal"):
        solve_graph(part, solver)


@pytest.mark.parametrize("roadmap", ROADMAPS)
def test_costs_to_the_base_are_those_of_the_matrix(roadmap):
    g = graph(roadmap)
    assert np.allclose(g.costs_to_base[1:], g.costs[0, 1:], rtol=1e-12)


@pytest.mark.parametrize("solver", ["auto", "mip", "dp", "lns", "reduced-mip", "anneal", "greedy"])
def test_progress_carries_the_tour(solver):
    """Of the graph given, whatever part of it the solver works on; the last is the best."""
    problem = random_world(11, goals=9, tether=330.0)
    graph = travel_graph(problem)
    rows = []
    found = solve_graph(graph, solver, on_progress=rows.append, seed=1)
    told = [r for r in rows if r.tour is not None]
    assert told
    for row in told:
        assert graph.is_tour(row.tour)
        if solver != "greedy":  # it retraces its steps
            assert graph.tour_length(row.tour) == pytest.approx(row.incumbent)
    assert told[-1].tour == found.tour


def test_progress_over_few_classes_first_carries_tours_of_the_whole_graph():
    problem = random_world(12, goals=26, tether=300.0)
    graph = travel_graph(problem, max_classes=130)
    assert not graph.is_complete
    rows = []
    solve_graph(graph, on_progress=rows.append, time_limit=1.5)
    told = [r for r in rows if r.tour is not None]
    assert told
    for row in told:
        assert graph.is_tour(row.tour)
        assert graph.tour_length(row.tour) == pytest.approx(row.incumbent)
