"""Inequalities of even crossing: valid for tours, over goals and over classes, certified, and worth
something."""

import itertools
import math
import random
import sys
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import Circle, Problem, Status, solve_graph, travel_graph
from netsp.base.clock import Clock
from netsp.base.errors import LimitReachedError
from netsp.gtsp.cost_oracle import MatrixCosts
from netsp.gtsp.gtsp_policy import CostPolicy, GtspPolicy, ProofSearchPolicy
from netsp.gtsp.limits import Limits
from netsp.gtsp.solver_run import RunStopped
from netsp.gtsp.travel.parity_distances import ParityDistances
from netsp.mip import root
from netsp.mip.cover_costs import ClassCovers, PathCovers
from netsp.mip.covers import cover_steps, refine_covers
from netsp.mip.cuts import Cut, cut_coefficients
from netsp.mip.deadlegs import DeadLegs
from netsp.mip.goal_relaxation import CoverCosts, bound_over_goals
from netsp.mip.highs import HighsRelaxation
from netsp.mip.lagrangian_bound import exact_bound
from netsp.mip.legprices import LegPrices
from netsp.mip.mip_policy import CoverPolicy, MipPolicy, TimePolicy
from netsp.mip.mip_solver import MipRun, Params, solve
from netsp.mip.parity_cuts import odd_numbers, parity_cuts
from netsp.mip.prices import Prices
from netsp.mip.program import duals_of_relaxation
from netsp.plan.random_worlds import random_world
from netsp.plan.solve_policy import RoutePolicy, SolvePolicy
from netsp.roadmap.travel_graph import TravelGraph
from tests.brute import brute_tour
from tests.cut_points import all_legs, small, tours_as_points, towers
from tests.travel_graphs import random_graph
from tests.worlds import costs_of


def some_cut(chance, graph):
    """Any set of vertices, and an odd number of pairs of clusters."""
    inside = np.array([chance.random() < 0.5 for _ in graph.cluster])
    pairs = list(itertools.combinations(range(graph.goal_count + 1), 2))
    count = chance.choice([k for k in (1, 3, 5) if k <= len(pairs)])
    return Cut(inside, -1, tuple(sorted(chance.sample(pairs, count))))


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.randoms(use_true_random=False))
def test_no_tour_violates_an_inequality_of_any_set_of_vertices(seed, chance):
    graph = random_graph(seed, 6, most=3)
    legs, _ = all_legs(graph)
    cuts = [some_cut(chance, graph) for _ in range(8)]
    rows = cut_coefficients(cuts, graph.cluster, legs)
    for _, y in tours_as_points(chance, graph, legs):
        assert (rows @ y >= [-2.0 * c.rhs - 1e-9 for c in cuts]).all()


@pytest.mark.parametrize("seed", range(4))
def test_bounds_with_split_clusters_are_below_their_certificate_and_the_optimum(seed):
    graph = random_graph(seed, 6, most=3)
    legs, costs = all_legs(graph)
    lp = HighsRelaxation(graph.cluster, legs, costs)
    lp.add_cuts([some_cut(random.Random(seed + k), graph) for k in range(25)])
    point = lp.solve(60.0)
    assert (point.slack > -1e-6).all()
    assert any(c.splits_clusters(graph.cluster) for c in lp.cuts)
    rng = np.random.default_rng(seed)
    for scale in (0.0, 1e-3, 1.0):
        duals = duals_of_relaxation(
            point.duals.cluster / 2.0 + scale * rng.normal(size=len(point.duals.cluster)),
            -point.duals.cut / 2.0 + scale * np.abs(rng.normal(size=len(lp.cuts))),
            lp.cuts, graph.cluster,
        )  # fmt: skip
        dead = DeadLegs(~np.isfinite(graph.costs))
        prices = Prices(costs_of(graph), dead, graph.cluster, lp.cuts, duals)
        exact = exact_bound(graph.costs, graph.cluster, lp.cuts, duals)
        assert prices.bound <= exact <= brute_tour(graph) * (1 + 1e-12)
        assert float(exact) - prices.bound <= 1e-9 * max(1.0, scale) * len(lp.cuts)
        listed = LegPrices(legs, costs, graph.cluster, lp.cuts, duals)
        assert listed.bound == pytest.approx(prices.bound, abs=1e-9 * max(1.0, scale))
        if scale == 0.0:
            assert prices.bound >= point.objective * (1.0 - 1e-6)


@pytest.mark.parametrize("seed", range(6))
def test_bounds_hold_where_a_tooth_does_not_cross_any_more(seed):
    """Vertices that were forgotten may leave both clusters of a tooth on one side."""
    graph, rng = random_graph(seed, 6, most=3), np.random.default_rng(seed)
    side = rng.random(graph.goal_count + 1) < 0.5
    cuts = [
        Cut(side[graph.cluster], -1, ((0, 1), (2, 3), (4, 5))),
        Cut(np.ones(len(graph), dtype=bool), -1, ((1, 2),)),
    ]
    duals = duals_of_relaxation(
        np.full(graph.goal_count + 1, 5.0), np.array([20.0, 30.0]), cuts, graph.cluster
    )
    dead = DeadLegs(~np.isfinite(graph.costs))
    bound = Prices(costs_of(graph), dead, graph.cluster, cuts, duals).bound
    exact = float(exact_bound(graph.costs, graph.cluster, cuts, duals))
    assert bound == pytest.approx(exact, abs=1e-6)
    assert bound <= brute_tour(graph) * (1 + 1e-12)


def test_a_ring_that_lies_on_two_sheets_by_halves_is_cut():
    """Three goals around an obstacle: from the third one the ring returns on the other sheet."""
    cluster = np.array([0, 1, 1, 2, 2, 3, 3])
    odd = np.array([[False], *[[False], [True]] * 3])
    legs = np.array([(1, 3), (3, 5), (2, 5), (2, 4), (4, 6), (1, 6)])
    y = np.full(6, 0.5)
    (cut, *_) = parity_cuts(legs, y, cluster, odd)
    assert cut.teeth == ((1, 3),)
    assert (cut_coefficients([cut], cluster, legs) @ y)[0] == pytest.approx(-2.0 * cut.rhs - 1.0)


@pytest.mark.parametrize("seed", range(4))
def test_ways_are_the_shortest_legs_of_their_parity(seed):
    graph = travel_graph(small(seed, tether_length=150.0))
    ways = graph.parity_oracle(lambda: False)
    odd, cluster = odd_numbers(graph.labels, ways.barriers), graph.cluster
    best = {}
    for u, v in itertools.combinations(range(len(graph)), 2):
        a, b = sorted((int(cluster[u]), int(cluster[v])))
        key = a, b, (odd[u] ^ odd[v]).tobytes()
        best[key] = min(best.get(key, math.inf), graph.costs[u, v])
    rows = np.arange(len(ways.ends))
    found = {
        (*e, o.tobytes()): length
        for e, o, length in zip(
            ways.ends.tolist(), ways.odd_of(rows), ways.length.tolist(), strict=True
        )
    }
    assert len(found) == len(rows)
    within = {k: c for k, c in best.items() if c <= ways.reach - 1e-6}
    assert within
    for key, cost in within.items():
        assert found[key] <= cost + 1e-6
        # a leg between classes that the tether reaches is a path as well
        if found[key] <= 100.0:
            assert found[key] == pytest.approx(cost, abs=1e-6)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("obstacles", [(), (1,), (2, 0), (0, 1, 2, 3)])
def test_a_leg_between_cells_costs_no_more_than_any_between_their_classes(seed, obstacles):
    graph, odd, *both = towers(seed)
    for tower in both:
        cells = tower.cells(obstacles)
        own, costs = cells.cells_of(graph.cluster, odd), tower.costs(cells)
        assert (own >= 0).all()
        assert own[0] == 0
        assert (cells.cluster[own] == graph.cluster).all()
        least = np.full(costs.shape, np.inf)
        np.minimum.at(least, (own[:, None], own[None, :]), graph.costs)
        if tower is both[0]:
            np.testing.assert_array_equal(costs, least)
        assert (costs <= least + 1e-9).all()


@pytest.mark.parametrize("seed", range(4))
def test_bounds_of_covers_hold_and_what_they_rule_out_is_in_no_best_tour(seed):
    graph, odd, *both = towers(seed)
    best = solve_graph(graph, "auto")
    least = bound_over_goals(graph, proven_goals, Limits()).bound
    stops = [(int(graph.cluster[v]), odd[v]) for v in best.tour]
    for tower in both:
        found = refine_covers(tower, stops, best.length * 1.02, Limits())
        assert least * (1.0 - 1e-6) <= found.bound <= best.length * 1.02
        own = found.cells.cells_of(graph.cluster, odd)[list(best.tour)]
        assert found.alive[own].all()
        assert not found.dead[own, np.roll(own, -1)].any()
        if found.bound < best.length:
            # as bounds over classes, from the dual values of the cells
            own = found.cells.cells_of(graph.cluster, odd)
            dead, cuts = DeadLegs.missing(graph.costs), found.lifted_cuts(own)
            duals = found.lifted_duals(own)
            prices = Prices(costs_of(graph), dead, graph.cluster, cuts, duals)
            assert prices.bound <= best.length * (1.0 + 1e-9)


def around(radius=10.0, goals=6):
    """Goals on a circle around an obstacle, and the base among them."""
    angles = 2.0 * np.pi * np.arange(goals + 1) / (goals + 1)
    places = 1.6 * radius * np.column_stack([np.cos(angles), np.sin(angles)])
    return Problem(
        base=tuple(places[0]), goals=[tuple(p) for p in places[1:]], tether_length=20.0 * radius,
        obstacles=[Circle(center=(0.0, 0.0), radius=radius)],
    )  # fmt: skip


def proven_goals(graph, limits):
    return solve(graph, limits=limits), ()


@pytest.mark.parametrize("kind", ["classes", "ways"])
def test_two_sheets_know_that_a_ring_around_an_obstacle_is_no_tour(kind):
    """The tour over shortest paths goes around once; one that is not entangled leaves out a piece
    of the ring and returns."""
    graph = travel_graph(around())
    best, odd = solve_graph(graph, "auto"), odd_numbers(graph.labels)
    assert bound_over_goals(graph, proven_goals, Limits()).bound < 0.9 * best.length
    tower = (
        ClassCovers(graph.costs, graph.cluster, odd) if kind == "classes"
        else PathCovers(graph.parity_oracle(lambda: False), np.inf)
    )  # fmt: skip
    stops = [(int(graph.cluster[v]), odd[v]) for v in best.tour]
    found = refine_covers(tower, stops, best.length, Limits())
    assert found.cells.barriers == (0,)
    assert found.bound == pytest.approx(best.length, rel=1e-5)


FEW_MEASURED = GtspPolicy(costs=CostPolicy(max_measured_vertices=50))


@pytest.mark.parametrize("most", [30, 6000])
@pytest.mark.parametrize("seed", range(2))
def test_covers_in_between_prove_the_same(seed, most, monkeypatch):
    """With all covers, and where the classes come after the goals at once."""
    problem = random_world(seed, goals=14, tether_length=320.0)
    whole, seen = solve(travel_graph(problem)), []

    def noted_steps(*args, **more):
        seen.append((yield from cover_steps(*args, **more)))
        return seen[-1]

    monkeypatch.setattr("netsp.mip.goal_relaxation.cover_steps", noted_steps)
    covers = CoverPolicy(min_classes=50, max_cells=most)
    policy = MipPolicy(many_goals=5, covers=covers, gtsp=FEW_MEASURED)
    fewer = solve(travel_graph(problem), Params(policy=policy))
    assert len(seen) == 1
    assert whole.status is fewer.status is Status.OPTIMAL
    assert fewer.length == pytest.approx(whole.length, rel=2e-6)


@pytest.mark.parametrize("limits", [{"time_limit": 3.0}, {"iteration_limit": 3000}])
def test_beyond_reach_of_the_program_over_all_classes_the_time_left_is_for_the_search(
    limits, monkeypatch
):
    problem = random_world(0, goals=14, tether_length=320.0)
    whole = solve(travel_graph(problem))
    policy = MipPolicy(
        many_goals=5,
        large_goal_count=5,
        max_gap_after_covers=0.0,
        covers=CoverPolicy(min_classes=50, max_cells=16),
        gtsp=FEW_MEASURED,
    )
    graph = travel_graph(problem)
    found = solve_graph(graph, "mip", params={"policy": policy}, **limits)
    assert graph.is_tour(found.tour)
    assert found.lower_bound <= whole.length * (1.0 + 1e-6)
    assert found.length >= whole.length * (1.0 - 1e-6)
    stages = [r.stage for r in found.trace]
    assert "covers" in stages
    # without a limit of time there would be no end of searches
    assert ("root" in stages) == ("iteration_limit" in limits)
    assert ("merged" in stages) == ("time_limit" in limits)


def test_however_long_covers_take_the_core_has_its_share_of_what_is_left(monkeypatch):
    module = sys.modules["netsp.mip.mip_solver"]
    began, proven = [], []

    def slowly(run, backend):
        until = run.clock.elapsed + 0.6 * run.clock.left
        while run.clock.elapsed < until:
            time.sleep(0.01)
        began.append(run.clock.left)

    def program(run, known=module.MipRun.program):
        proven.append(run.is_done)
        return known(run)

    monkeypatch.setattr(module.MipRun, "bound_by_goals", slowly)
    monkeypatch.setattr(module.MipRun, "program", program)
    graph = travel_graph(random_world(0, goals=14, tether_length=320.0))
    core = GtspPolicy(FEW_MEASURED.costs, proof_search=ProofSearchPolicy(min_core_ratio=1.0))
    params = {"policy": MipPolicy(core_classes=50, gtsp=core)}
    found = solve_graph(graph, "mip", params=params, time_limit=10.0)
    assert began
    assert proven[0]
    assert graph.is_tour(found.tour)


def share_of_covers(goals, classes):
    cluster = np.sort(np.append(np.arange(goals + 1), np.ones(classes - goals - 1, dtype=int)))
    costs = MatrixCosts(np.broadcast_to(1.0, (classes, classes)), cluster)
    graph = TravelGraph(cluster, [()] * classes, np.ones(classes), costs)
    return MipRun(graph)._cover_time_share


def test_covers_have_more_of_the_time_the_more_classes_there_are():
    shares = [share_of_covers(100, n) for n in (500, 3000, 9000, 13_000, 20_000)]
    policy = TimePolicy()
    assert shares[0] == policy.goal_share
    assert shares[-1] == policy.cover_share
    assert shares == sorted(shares)
    assert len(set(shares)) > 3


def test_with_hundreds_of_goals_covers_have_all_the_time_that_they_may():
    policy = MipPolicy()
    assert share_of_covers(policy.large_goal_count + 1, 500) == policy.time.cover_share


@pytest.mark.parametrize("seed", range(2))
def test_with_too_many_classes_for_a_matrix_covers_bound_the_tour(seed, monkeypatch):
    problem = random_world(seed, goals=26, tether_length=300.0)
    best = solve_graph(travel_graph(problem), "auto")
    goals = bound_over_goals(travel_graph(problem), proven_goals, Limits()).bound
    mip = MipPolicy(covers=CoverPolicy(min_classes=30))
    policy = SolvePolicy(routes=RoutePolicy(max_proven_vertices=30), mip=mip)
    found = solve_graph(travel_graph(problem), "auto", time_limit=3.0, params={"policy": policy})
    assert found.lower_bound <= best.length * (1.0 + 1e-6)
    assert found.length >= best.length * (1.0 - 1e-6)
    assert found.lower_bound > goals
    assert {"covers", "goals"} <= {r.stage for r in found.trace}


def test_more_obstacles_than_a_word_of_the_machine_has_bits():
    rows = np.array([[1 << 63, 1], [0, 1 << 5]], dtype=np.uint64)
    ways = ParityDistances(np.array([(0, 1), (0, 2)]), rows, np.array([1.0, 2.0]), 9.0, 70)
    assert [np.flatnonzero(o).tolist() for o in ways.odd_of(np.arange(2))] == [[63, 64], [69]]
    cells = PathCovers(ways, np.inf).cells((64, 69))
    assert list(zip(cells.cluster, cells.code, strict=True)) == [(0, 0), (1, 1), (2, 2)]


def test_no_time_leaves_a_bound_that_holds():
    graph = travel_graph(small(1))
    clock = Clock()
    clock.end()
    found = bound_over_goals(graph, proven_goals, Limits(clock))
    assert 0.0 <= found.bound <= solve_graph(graph, "auto").length


@pytest.mark.parametrize("seed", range(4))
def test_auto_has_a_tour_and_a_bound_whatever_the_time(seed):
    problem = random_world(seed, goals=15, tether_length=300.0)
    best = solve_graph(travel_graph(problem), "auto")
    clock = Clock()
    clock.end()
    found = solve_graph(travel_graph(problem), "auto", time_limit=clock)
    assert 0.3 * best.length < found.lower_bound <= best.length <= found.length
    assert found.status is Status.FEASIBLE


def test_the_legs_of_a_matrix_that_takes_too_long_leave_the_bound_over_goals():
    graph = travel_graph(small(1))
    best = solve_graph(graph, "auto").length

    def too_long():
        raise LimitReachedError("the time is up")

    policy = MipPolicy(covers=CoverPolicy(min_classes=10))
    costs = CoverCosts(too_long)
    with pytest.raises(LimitReachedError):
        bound_over_goals(graph, proven_goals, Limits(), [0], costs, policy=policy)
    assert 0.5 * best < graph.bound_in_any_class <= best


@pytest.mark.parametrize("press", [KeyboardInterrupt, RunStopped])
def test_covers_that_are_stopped_keep_what_they_have_proven(press, monkeypatch):
    graph, odd, tower, _ = towers(2)
    best, clock = solve_graph(graph, "auto"), Clock()
    stops = [(int(graph.cluster[v]), odd[v]) for v in best.tour]
    relaxed, heard = root.Root._solve_lp, []

    def stopping(self):
        if heard and len(self.costs) > graph.goal_count + 1:
            raise press
        return relaxed(self)

    monkeypatch.setattr(root.Root, "_solve_lp", stopping)
    found = refine_covers(
        tower, stops, 1.5 * best.length, Limits(clock), lambda *b: heard.append(b)
    )
    assert len(heard) >= 1
    assert found.bound == heard[-1][0] > 0.0
    assert clock.is_up == (press is KeyboardInterrupt)
