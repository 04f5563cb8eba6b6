"""Walks that are partly remembered: their bounds, what they rule out, and the solver on top."""

import itertools
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import InputError, Status, TravelGraph, solve_graph, travel_graph
from netsp.gtsp.dp.label_kernels import translate
from netsp.gtsp.dp.ng_sets import MAX_REMEMBERED, Memory
from netsp.gtsp.dp.walks import Walks
from netsp.gtsp.gtsp_policy import WalkPolicy
from netsp.gtsp.solver_run import RunStopped
from netsp.mip.deadlegs import DeadLegs
from netsp.mip.prices import Prices
from netsp.mip.program import Duals
from tests.brute import brute_tour
from tests.travel_graphs import bound_legs_first, random_graph
from tests.worlds import costs_of, random_world


def tours(graph):
    """(length, vertices) of every tour, from the base on."""
    costs = graph.costs
    goals = range(1, graph.goal_count + 1)
    for order in itertools.permutations(goals):
        for chosen in itertools.product(*(graph.members(g).tolist() for g in order)):
            stops = [0, *chosen, 0]
            yield sum(costs[a, b] for a, b in itertools.pairwise(stops)), chosen


def walks_of(graph, remembered):
    walks = Walks(graph.cluster, costs_of(graph))
    near = np.argsort(np.random.default_rng(0).random((walks.n + 1, walks.n + 1)), axis=1)
    walks.memory = Memory(near, remembered)
    return walks


def random_prices(seed, graph, size=1.0):
    rng = np.random.default_rng(seed)
    return np.concatenate([[0.0], size * rng.uniform(-0.5, 1.0, graph.goal_count)])


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 5), st.integers(2, 6))
def test_no_tour_is_shorter_than_the_cheapest_walk(seed, remembered, goals):
    graph = random_graph(seed, goals, most=3)
    walk = walks_of(graph, remembered).solve(random_prices(seed, graph), np.inf, lambda: None)
    assert walk.bound <= brute_tour(graph)


@pytest.mark.parametrize("seed", range(6))
def test_walks_that_remember_everything_are_tours(seed):
    graph = random_graph(seed, 5, most=3)
    walk = walks_of(graph, 5).solve(random_prices(seed, graph), np.inf, lambda: None)
    assert sorted(graph.cluster[walk.rows]) == [1, 2, 3, 4, 5]
    assert walk.bound == pytest.approx(brute_tour(graph), rel=1e-9)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 4), st.floats(1.0, 1.3))
def test_no_tour_below_the_cutoff_visits_a_dead_state(seed, remembered, slack):
    graph = random_graph(seed, 4, most=3)
    cutoff = slack * brute_tour(graph)
    walks = walks_of(graph, remembered)
    prices = random_prices(seed, graph, 0.3)
    for _ in range(3):
        walk = walks.solve(prices, cutoff, lambda: None)
        if walk is None:
            break
        walks.memory.widen(graph.cluster[walk.rows].tolist())
        prices += 0.1 * (1.0 - np.bincount(graph.cluster[walk.rows], minlength=5))
    place = np.argsort(walks.order)
    for length, chosen in tours(graph):
        if length < cutoff * (1.0 - 1e-9):
            assert all(walks.alive[k, place[v]] for k, v in enumerate(chosen, start=1))


@pytest.mark.parametrize("seed", range(5))
def test_a_bound_is_below_its_own_walk_summed_in_exact_rationals(seed):
    graph = random_graph(seed, 8)
    walks = walks_of(graph, 3)
    prices = random_prices(seed, graph)
    walk = walks.solve(prices, np.inf, lambda: None)
    stops = [0, *walk.rows.tolist(), 0]
    exact = sum(Fraction(float(graph.costs[a, b])) for a, b in itertools.pairwise(stops))
    exact += sum(Fraction(p) for p in prices[1:].tolist())
    exact -= sum(Fraction(float(prices[graph.cluster[v]])) for v in walk.rows)
    assert Fraction(walk.bound) < exact
    assert exact - Fraction(walk.bound) <= Fraction(2.0 * walks.rounding(prices))


@pytest.mark.parametrize("shuffled", [False, True])
def test_a_matrix_is_taken_over_block_by_block_until_the_flag_is_set(shuffled):
    graph = random_graph(5, goals=6, most=5)
    order = np.random.default_rng(0).permutation(len(graph)) if shuffled else np.arange(len(graph))
    cluster, costs = graph.cluster[order], graph.costs[np.ix_(order, order)].astype(np.float32)
    whole = Walks(cluster, costs)
    blocks = Walks(cluster, costs, policy=WalkPolicy(block_rows=3))
    assert (whole.values == blocks.values).all()
    assert whole.values.dtype == np.float64
    assert (whole.values == costs[np.ix_(whole.order, whole.order)]).all()
    assert whole.longest == blocks.longest == costs[np.isfinite(costs)].max()
    assert (whole._near() == blocks._near()).all()
    policy = WalkPolicy(block_rows=3)
    walks = Walks(cluster, costs, np.ones(1, dtype=np.int64), policy=policy)

    def check():
        raise RunStopped

    with pytest.raises(RunStopped):
        walks.solve(np.zeros(walks.n + 1), 1e9, check)


@settings(max_examples=40, deadline=None)
@given(st.integers(1, 30), st.integers(1, MAX_REMEMBERED), st.randoms(use_true_random=False))
def test_memory_is_the_intersection_with_what_the_next_goal_remembers(n, size, random):
    near = np.array([random.sample(range(n + 1), n + 1) for _ in range(n + 1)])
    memory = Memory(near, size)
    for _ in range(3):
        memory.widen([random.randint(1, n) for _ in range(12)])
    tables = memory.tables()
    for _ in range(30):
        g, h = random.randint(1, n), random.randint(1, n)
        if g == h:
            continue
        held = {g, *random.sample(memory.sets[g], random.randint(0, len(memory.sets[g])))}
        mask = sum(1 << k for k, q in enumerate(memory.sets[g]) if q in held)
        found = translate(tables, g, h, mask)
        if h in held:
            assert found < 0
        else:
            there = {h} | (held & set(memory.sets[h]))
            assert found == sum(1 << k for k, q in enumerate(memory.sets[h]) if q in there)


@pytest.mark.parametrize("seed", range(4))
def test_more_memory_raises_the_bound_or_leaves_it(seed):
    graph = random_graph(seed, 9)
    walks = walks_of(graph, 1)
    before = -np.inf
    while True:
        walk = walks.solve(random_prices(seed, graph), np.inf, lambda: None)
        assert walk.bound >= before - 1e-9
        before = walk.bound
        if not walks.memory.widen(graph.cluster[walk.rows].tolist()):
            break
    assert len(set(walk.rows.tolist())) == 9


def test_labels_do_not_depend_on_how_many_share_the_work():
    graph = travel_graph(random_world(3, circles=10, goals=9, tether=300.0))
    found = []
    for threads in (1, 2, 5):
        walks = Walks(graph.cluster, costs_of(graph), policy=WalkPolicy(threads=threads))
        walk = walks.solve(np.zeros(10), np.inf, lambda: None)
        found.append((walk.bound, walk.labels, walk.rows.tolist()))
    assert found[0] == found[1] == found[2]


@pytest.mark.parametrize("at_once", [True, False])
@pytest.mark.parametrize("seed", range(6))
def test_dp_proves_the_same_optimum_as_mip_whether_legs_are_measured_or_bounded(
    seed, at_once, monkeypatch
):
    problem = random_world(seed, circles=12, goals=7, tether=330.0)
    expected = solve_graph(travel_graph(problem), "mip").length
    if not at_once:
        bound_legs_first(monkeypatch)
    params = {"search_rounds": 0, "policy.costs.max_measured_vertices": 20}
    result = solve_graph(travel_graph(problem), "dp", params=params)
    assert result.status is Status.OPTIMAL
    assert result.length == pytest.approx(expected, rel=2e-6)


@pytest.mark.parametrize("seed", range(4))
def test_vertices_need_not_be_grouped_by_goal(seed):
    graph = random_graph(seed, 6)
    mixed = np.concatenate([[0], 1 + np.random.default_rng(seed).permutation(len(graph) - 1)])
    other = TravelGraph.from_costs(graph.costs[np.ix_(mixed, mixed)], graph.cluster[mixed])
    result = solve_graph(other, "dp")
    assert result.status is Status.OPTIMAL
    assert result.length == pytest.approx(brute_tour(graph), rel=2e-6)


def test_dp_refuses_what_would_not_fit_into_memory():
    params = {"policy.walks.max_table_cells": 10}
    with pytest.raises(InputError, match="too much memory; use 'auto' or 'lns'"):
        solve_graph(random_graph(0, 4), "dp", params=params)


@pytest.mark.parametrize("solver", ["dp", "auto", "mip"])
def test_no_tour_is_proven_where_goals_are_joined_to_the_base_alone(solver):
    costs = np.full((4, 4), np.inf)
    costs[0, 1:] = costs[1:, 0] = 1.0
    result = solve_graph(TravelGraph.from_costs(costs, [0, 1, 2, 3]), solver)
    assert result.status is Status.INFEASIBLE


@pytest.mark.parametrize("solver", ["dp", "auto"])
def test_legs_a_million_times_the_tour_end_the_walks_all_the_same(solver):
    costs = np.full((5, 5), 1e7)
    for a, b in ((0, 1), (1, 2), (2, 3), (0, 3)):
        costs[a, b] = costs[b, a] = 1.0 + 0.1 * a
    result = solve_graph(TravelGraph.from_costs(costs, [0, 1, 2, 3, 3]), solver)
    assert result.length == pytest.approx(4.3)
    assert result.trace[-1].iteration < 50
    assert solver == "dp" or result.status is Status.OPTIMAL


def test_a_tour_through_a_vertex_pays_what_it_costs_above_the_cheapest_of_its_cluster():
    cluster = np.array([0, 1, 1, 2])
    duals = Duals(np.zeros(3), np.array([0.0, 0.0, 2.5, 0.0]), np.zeros(0))
    costs = np.where(cluster[:, None] == cluster[None, :], np.inf, 0.0)
    costs[2], costs[:, 2] = costs[2] + 2.5, costs[:, 2] + 2.5
    for cutoff, gone in ((5.1, False), (4.9, True)):
        dead = DeadLegs(~np.isfinite(costs))
        prices = Prices(costs, dead, cluster, [], duals)
        assert prices.bound == pytest.approx(0.0, abs=1e-9)
        prices.fix_out(cutoff)
        assert bool(dead.matrix()[2].all()) is gone
        assert not dead.matrix()[1, 0]
