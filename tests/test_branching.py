"""Branch and cut: nothing is lost on the way, and every bound holds."""

import contextlib
import itertools
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp.gtsp.cost_matrix import CostMatrix
from netsp.gtsp.gtsp_policy import CostPolicy
from netsp.gtsp.limits import Limits
from netsp.gtsp.solver_run import RunStopped
from netsp.mip.branching import Tree
from netsp.mip.combs import comb_cuts
from netsp.mip.cuts import Cut, cut_coefficients
from netsp.mip.deadlegs import DeadLegs
from netsp.mip.highs import HighsRelaxation
from netsp.mip.legprices import LegPrices
from netsp.mip.mip_solver import MipRun
from netsp.mip.prices import Prices
from netsp.mip.program import duals_of_relaxation
from netsp.mip.root import Root
from netsp.mip.subtours import component_cuts
from netsp.roadmap.travel_graph import TravelGraph
from tests.brute import brute_tour
from tests.cut_points import all_legs, some_cut, tours_as_points
from tests.travel_graphs import random_graph
from tests.worlds import costs_of


def root_of(graph, *, tour=None, rows=None, costs=CostPolicy()):
    """A root that has done nothing but hold all legs, with a poor tour or none."""
    run = MipRun(graph, Limits(on_progress=None if rows is None else rows.append))
    run.update_incumbent(tour)
    return Root(run, CostMatrix(graph, policy=costs), HighsRelaxation, run.round_point)


def test_the_first_legs_of_every_vertex_are_found_in_little_memory():
    """Of ten rows at a time, and nothing of these is kept but a few legs."""
    graph = random_graph(0, 60, most=12)
    tour = [0, *(graph.members(g)[0] for g in range(1, 61))]
    root = root_of(graph, tour=tour, costs=CostPolicy(block_rows=10))
    tracemalloc.start()
    legs = root._first_legs()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 0.5 * 8 * len(graph) ** 2
    nearest = np.argsort(graph.costs, axis=1)[:, :4]
    assert {tuple(sorted((u, v))) for u, row in enumerate(nearest.tolist()) for v in row} <= set(
        map(tuple, legs.tolist())
    )


def only_what_a_whole_point_needs(root, point):
    whole = np.abs(point.y - np.rint(point.y)).max() < 1e-6
    return component_cuts(point.x, point.legs, point.y, root.costs.cluster) if whole else []


@pytest.mark.parametrize("cuts", [True, False])
@pytest.mark.parametrize("start", [True, False])
@pytest.mark.parametrize("seed", range(12))
def test_branching_alone_finds_the_shortest_tour_and_proves_it(seed, start, cuts, monkeypatch):
    if not cuts:
        monkeypatch.setattr(Root, "separate", only_what_a_whole_point_needs)
    monkeypatch.setattr(MipRun, "offer_rounded", _as_it_is)
    graph, rows = random_graph(seed, 6, most=3), []
    some = [0, *(graph.members(g)[0] for g in range(1, 7))]
    root = root_of(graph, tour=some if start else None, rows=rows)
    Tree(root).solve()
    best = brute_tour(graph)
    assert root.run.is_done
    assert root.run.length == pytest.approx(best)
    assert all(r.bound.length <= best * (1 + 1e-9) for r in rows)


def _as_it_is(run, costs, point, *, is_whole):
    """Take a point that is a tour for one, without a search that would find better."""
    from netsp.mip.subtours import cycles_of

    cycles = cycles_of(point.x, point.legs, point.y)
    if is_whole and len(cycles) == 1:
        run.update_incumbent(costs.vertices[cycles[0]].tolist())


DEAD_END = ((0, 1), (1, 2), (0, 2), (2, 3))
BRIDGE = ((0, 1), (1, 2), (0, 2), (2, 3), (3, 4), (4, 5), (3, 5))


@pytest.mark.parametrize("legs", [DEAD_END, BRIDGE])
@pytest.mark.parametrize("with_ray", [True, False])
def test_that_there_is_no_tour_is_said_only_where_it_is_proven(legs, with_ray, monkeypatch):
    if not with_ray:
        monkeypatch.setattr(HighsRelaxation, "rays", lambda lp: [])
    cluster = np.arange(max(max(leg) for leg in legs) + 1)
    costs = np.full((len(cluster), len(cluster)), np.inf)
    for u, v in legs:
        costs[u, v] = costs[v, u] = 1.0
    root = root_of(TravelGraph.from_costs(costs, cluster))
    with contextlib.nullcontext() if with_ray else pytest.raises(RunStopped):
        Tree(root).solve()
    assert root.run.is_infeasible == with_ray


def test_a_tree_that_is_stopped_claims_no_more_than_its_open_nodes(monkeypatch):
    monkeypatch.setattr(Root, "separate", only_what_a_whole_point_needs)
    graph = random_graph(7, 8, most=3)
    best = brute_tour(graph)
    some = [0, *(graph.members(g)[0] for g in range(1, 9))]
    bounds = []
    for programs in (1, 2, 3, 5, 8, 13):
        root = root_of(graph, tour=some)
        root.run.iteration_limit = programs
        with root.run.until_stopped():
            Tree(root).solve()
        bounds.append(root.run.bound)
        assert root.run.bound <= best * (1 + 1e-9)
    assert bounds == sorted(bounds)
    assert bounds[-1] > bounds[0]


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.randoms(use_true_random=False), st.floats(0.0, 1.0))
def test_prices_of_a_list_of_legs_are_those_of_a_matrix(seed, chance, scale):
    graph = random_graph(seed, 6, most=3)
    rng = np.random.default_rng(seed)
    legs, _ = all_legs(graph)
    legs = legs[rng.random(len(legs)) < 0.9]
    dead = np.ones(graph.costs.shape, dtype=bool)
    dead[legs[:, 0], legs[:, 1]] = dead[legs[:, 1], legs[:, 0]] = False
    cuts = [some_cut(chance, graph) for _ in range(5)]
    duals = duals_of_relaxation(
        scale * rng.normal(size=7), scale * np.abs(rng.normal(size=5)), cuts, graph.cluster
    )
    dead = DeadLegs(dead)
    of_matrix = Prices(costs_of(graph), dead, graph.cluster, cuts, duals)
    costs = graph.costs[legs[:, 0], legs[:, 1]]
    of_list = LegPrices(legs, costs, graph.cluster, cuts, duals)
    assert of_list.bound == pytest.approx(of_matrix.bound, abs=1e-9)
    if np.isfinite(of_list.bound):
        of_matrix.fix_out(of_matrix.bound + 0.3)
        gone = of_list.exceeds(of_matrix.bound + 0.3 - of_list.bound)
        by_matrix = dead[legs[:, 0], legs[:, 1]]
        # a matrix also forgets vertices, whose legs a list keeps
        assert not (gone & ~by_matrix).any()


def test_a_trial_leaves_the_program_as_it_was():
    graph = random_graph(3, 8)
    legs, costs = all_legs(graph)
    lp = HighsRelaxation(graph.cluster, legs, costs)
    before = lp.solve(60.0)
    used = int(np.argmax(before.y))
    alive = np.ones(len(legs), dtype=bool)
    alive[used] = False
    assert lp.probe(costs, alive, 1000) > before.objective
    lp.set_costs(costs)
    lp.set_alive(~np.zeros(len(legs), dtype=bool))
    assert lp.solve(60.0).objective == pytest.approx(before.objective)


def some_comb(chance, graph):
    """A handle, and an odd number of disjoint teeth partly in it."""
    m = graph.goal_count + 1
    clusters = chance.sample(range(m), m)
    teeth = []
    while len(clusters) > 1:
        k = chance.randint(2, min(3, len(clusters)))
        teeth.append(clusters[:k])
        clusters = clusters[k:]
    teeth = teeth[: len(teeth) - (len(teeth) + 1) % 2]
    handle = np.zeros(m, dtype=bool)
    for tooth in teeth:
        handle[chance.sample(tooth, chance.randint(1, len(tooth) - 1))] = True
    return Cut(handle[graph.cluster], -1, tuple(tuple(sorted(t)) for t in teeth))


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), st.randoms(use_true_random=False))
def test_no_tour_violates_a_comb(seed, chance):
    graph = random_graph(seed, 8, most=2)
    legs, _ = all_legs(graph)
    combs = [some_comb(chance, graph) for _ in range(8)]
    rows = cut_coefficients(combs, graph.cluster, legs)
    for tour, y in tours_as_points(chance, graph, legs):
        assert (rows @ y >= [-2.0 * c.rhs - 1e-9 for c in combs]).all()
        for comb in combs:
            within, times = comb.left_side(graph.cluster, legs)
            visited = sum(comb.inside[v] for v in tour)
            assert times @ y[within] <= visited + comb.rhs + 1e-9


def test_a_comb_is_found_where_no_pair_of_clusters_is_a_tooth():
    """A prism of halves, each corner on one side two clusters that are left as one."""
    corners = {3: (3, 6), 4: (4, 7), 5: (5, 8)}
    between = np.zeros((9, 9))
    for u, v in ((0, 1), (1, 2), (0, 2)):
        between[u, v] = 0.5
    for k, (a, b) in corners.items():
        between[k - 3, a] = between[k - 3, b] = 0.5
        between[a, b] = 1.0
    for (_, b), (c, _) in (
        (corners[3], corners[4]),
        (corners[4], corners[5]),
        (corners[5], corners[3]),
    ):
        between[b, c] = 0.5
    between += between.T
    assert (between.sum(axis=1) == 2.0).all()
    tight = [np.isin(np.arange(9), pair) for pair in corners.values()]
    cluster = np.arange(9)
    cuts = comb_cuts(between, tight, cluster)
    assert cuts
    legs = np.argwhere(np.triu(between, 1))
    y = between[legs[:, 0], legs[:, 1]]
    for cut in cuts:
        assert max(len(t) for t in cut.teeth) == 3
        assert (cut_coefficients([cut], cluster, legs) @ y)[0] < -2.0 * cut.rhs - 0.5
    assert not comb_cuts(between, [], cluster)


def test_every_two_children_share_the_tours_of_their_parent():
    graph = random_graph(5, 4, most=3)
    root = root_of(graph)
    tree = Tree(root)
    point = tree.lp.solve(60.0)
    # something of every leg, so that pairs of clusters and vertices are open
    point = replace(point, y=np.full(len(tree.legs), 0.05), x=np.full(len(graph), 0.3))
    place = {tuple(e): k for k, e in enumerate(tree.legs.tolist())}
    alive = np.ones(len(tree.legs), dtype=bool)
    choices = [*tree._choices(point, alive, ()), tree._halves(alive, ())]
    assert len(choices) > 1
    # a pair once is a pair, though the point has it in part
    (pair,) = choices[0].within[1]
    again = list(tree._choices(point, alive, (pair,)))
    assert all(len(set(p)) == len(p) for c in again for _, p in (c.without, c.within))
    has_pair = tree.pair == pair[0] * tree.clusters + pair[1]
    for order in itertools.permutations(range(1, 5)):
        for chosen in itertools.product(*(graph.members(g).tolist() for g in order)):
            tour = [0, *chosen]
            used = [place[min(e), max(e)] for e in zip(tour, [*chosen, 0], strict=True)]
            for choice in choices + (again if has_pair[used].any() else []):
                costs = []
                for legs, pairs in (choice.without, choice.within):
                    if legs[used].all():
                        costs.append(tree._costs(pairs)[used].sum() + tree.charge * len(pairs))
                assert min(costs) == pytest.approx(graph.tour_length(tour))


def test_nothing_shorter_than_a_known_tour_is_not_that_there_is_none():
    graph = random_graph(2, 6, most=3)
    best = brute_tour(graph)
    root = root_of(graph)
    root.run.known_length = 0.9 * best
    Tree(root).solve()
    assert root.run.tour is None
    assert not root.run.is_infeasible
    assert 0.9 * best * (1 - 1e-6) <= root.run.bound <= best
