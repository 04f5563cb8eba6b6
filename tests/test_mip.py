"""The mip solver proves what brute force finds, and is honest when it cannot."""

import gc
import itertools
import sys
import time
import weakref
from dataclasses import replace

import highspy
import numpy as np
import psutil
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csc_array, csr_array

from netsp import travel_graph
from netsp.gtsp import cost_matrix, searching
from netsp.gtsp.cost_matrix import CostMatrix
from netsp.gtsp.gtsp_policy import CostPolicy, GtspPolicy, ProofSearchPolicy
from netsp.gtsp.limits import Limits
from netsp.gtsp.params import read_params
from netsp.gtsp.solver_run import RunStopped
from netsp.gtsp.travel.costs import rounded_down
from netsp.mip import root
from netsp.mip import solve as mip
from netsp.mip.cbc_program import CbcRelaxation
from netsp.mip.cuts import Cut
from netsp.mip.deadlegs import DeadLegs, write_alive
from netsp.mip.flows import Edges, contracted
from netsp.mip.goal_relaxation import one_tree_bound
from netsp.mip.highs import HighsRelaxation
from netsp.mip.lagrangian_bound import exact_bound
from netsp.mip.mip_policy import CutPolicy, LpPolicy, MipPolicy, PricingPolicy, SchedulePolicy
from netsp.mip.mip_solver import MipRun, Params
from netsp.mip.prices import Prices
from netsp.mip.program import duals_of_relaxation
from netsp.mip.reducedcosts import reduced_costs_at
from netsp.mip.subtours import components, fractional_cuts, goal_cuts, strongest_cut
from netsp.model.solution import Status
from netsp.plan.random_worlds import random_world as far_world
from netsp.roadmap.taut import TautRoadmap
from netsp.roadmap.travel_graph import TravelGraph
from tests.brute import brute_tour as brute
from tests.travel_graphs import bound_legs_first, random_graph
from tests.worlds import costs_of, random_world


def solve(graph, params=None, **limits):
    """`mip` on a graph, with options and limits by name."""
    return mip(graph, read_params(Params, "mip", params), Limits(**limits))


BACKENDS = ["highs", "cbc"]
MIN_VIOLATION = CutPolicy().min_subtour_violation


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("seed", range(6))
def test_the_optimum_of_small_graphs_is_proven(seed, backend):
    graph = random_graph(seed, goals=3 + seed % 4)
    result = solve(graph, params={"backend": backend})
    best = brute(graph)
    assert result.status is Status.OPTIMAL
    assert graph.is_tour(result.tour)
    assert result.length == pytest.approx(graph.tour_length(result.tour))
    assert result.length == pytest.approx(best, rel=1e-6)
    assert result.lower_bound <= best * (1 + 1e-9)


@pytest.mark.parametrize("goals", [1, 2])
@pytest.mark.parametrize("seed", range(3))
def test_one_and_two_goals(goals, seed):
    graph = random_graph(seed, goals=goals)
    result = solve(graph)
    assert result.status is Status.OPTIMAL
    assert result.length == pytest.approx(brute(graph))


@pytest.mark.parametrize("seed", range(8))
def test_every_bound_on_the_way_is_below_the_optimum(seed):
    graph = random_graph(100 + seed, goals=6)
    best = brute(graph)
    rows = []
    solve(graph, params={"search_rounds": 0}, on_progress=rows.append)
    assert rows
    for row in rows:
        assert row.bound.length <= best * (1 + 1e-9)
        assert row.incumbent >= best * (1 - 1e-9)
    bounds = [r.bound.length for r in rows]
    assert bounds == sorted(bounds)


@pytest.mark.parametrize("backend", [HighsRelaxation, CbcRelaxation])
def test_any_dual_values_give_a_valid_bound(backend):
    """The bound stands on weak duality alone, so even perturbed duals must not lift it too far."""
    graph = random_graph(7, goals=5)
    best = brute(graph)
    legs = np.argwhere(np.triu(np.isfinite(graph.costs), 1))
    program = backend(graph.cluster, legs, graph.costs[legs[:, 0], legs[:, 1]])
    program.add_cuts([Cut(np.isin(graph.cluster, [1, 2]), 1), Cut(np.isin(graph.cluster, [3]), 3)])
    duals = program.solve(60.0).duals
    rng = np.random.default_rng(0)
    for scale in (0.0, 0.01, 0.1, 1.0):
        for _ in range(20):
            shaken = type(duals)(
                duals.cluster + scale * rng.normal(size=duals.cluster.shape),
                duals.degree + scale * rng.normal(size=duals.degree.shape),
                np.minimum(duals.cut + scale * rng.normal(size=duals.cut.shape), 0.0),
            )
            assert priced(graph, program.cuts, shaken).bound <= best + 1e-9
    assert priced(graph, program.cuts, duals).bound >= program.solve(60.0).objective - 1e-5


def test_a_program_that_is_built_in_pieces_is_the_same():
    graph = random_graph(7, goals=5)
    legs = np.argwhere(np.triu(np.isfinite(graph.costs), 1))
    costs, half = graph.costs[legs[:, 0], legs[:, 1]], len(legs) // 2
    cuts = [Cut(np.isin(graph.cluster, [k, k + 1]), k) for k in range(1, 5)]
    programs = []
    for policy in (MipPolicy(), MipPolicy(lp=LpPolicy(max_block_entries=7))):
        program = HighsRelaxation(graph.cluster, legs[:half], costs[:half], policy)
        program.add_cuts(cuts[:3])
        program.add_legs(legs[half:], costs[half:])
        program.add_cuts(cuts[3:])
        matrix = program._highs.getLp().a_matrix_
        by_columns = matrix.format_ == highspy.MatrixFormat.kColwise
        programs.append(
            (csc_array if by_columns else csr_array)(
                (matrix.value_, matrix.index_, matrix.start_),
                shape=(matrix.num_row_, matrix.num_col_),
            ).toarray()
        )
        np.testing.assert_array_equal(program.legs, legs)
        assert len(program.cuts) == 4
    np.testing.assert_array_equal(*programs)
    assert np.abs(programs[0][-4:]).sum(axis=1).all()


def priced(graph, cuts, duals):
    """All legs of a graph at dual values, none of them dead."""
    return Prices(costs_of(graph), DeadLegs.missing(graph.costs), graph.cluster, cuts, duals)


@pytest.mark.parametrize("seed", range(12))
def test_what_prices_rule_out_is_in_no_shorter_tour(seed):
    """Every tour below the cutoff is found among the legs that are left, whatever the duals, and
    good duals leave few others."""
    graph = random_graph(seed, goals=5)
    best = brute(graph)
    legs = np.argwhere(np.triu(np.isfinite(graph.costs), 1))
    program = HighsRelaxation(graph.cluster, legs, graph.costs[legs[:, 0], legs[:, 1]])
    for _ in range(8):
        point = program.solve(60.0)
        program.add_cuts(fractional_cuts(point.x, point.legs, point.y, graph.cluster))
    point = program.solve(60.0)
    rng = np.random.default_rng(seed)
    for scale in (0.0, 0.03, 0.3):
        shaken = replace(
            point.duals,
            degree=point.duals.degree + scale * rng.normal(size=point.duals.degree.shape),
            cut=np.minimum(
                point.duals.cut + scale * rng.normal(size=point.duals.cut.shape), 0.0
            ),
        )  # fmt: skip
        marks = DeadLegs.missing(graph.costs)
        prices = Prices(costs_of(graph), marks, graph.cluster, program.cuts, shaken)
        before = marks.left
        prices.fix_out(1.0001 * best)
        dead = marks.matrix()
        left = np.where(dead, np.inf, graph.costs)
        assert brute(TravelGraph.from_costs(left, graph.cluster)) == pytest.approx(best)
        assert scale > 0.0 or marks.left < before
        assert (dead == dead.T).all()


@pytest.mark.parametrize("share", [0.0, 0.5, 0.99, 1.0])
@pytest.mark.parametrize("size", [1, 7, 8, 9, 50, 700])
def test_marks_of_dead_legs_are_those_of_a_matrix(size, share):
    rng = np.random.default_rng(size)
    dead = rng.random((size, size)) < share
    dead |= dead.T
    marks = DeadLegs.missing(np.where(dead, np.inf, 1.0))
    gone = rng.random(size) < 0.1
    marks.add_vertices(gone)
    dead[gone] = dead[:, gone] = True
    legs = rng.integers(0, size, (20, 2))
    marks.revive(legs)
    dead[legs[:, 0], legs[:, 1]] = dead[legs[:, 1], legs[:, 0]] = False
    keep = rng.random(size) < 0.8
    for some in (np.ones(size, dtype=bool), keep):
        marks.restrict(some)
        dead = dead[np.ix_(some, some)]
        assert (marks.matrix() == dead).all()
        assert (marks.with_legs() == ~dead.all(axis=1)).all()
        assert marks.left == np.count_nonzero(~dead) // 2
        assert (marks.legs_left() == np.argwhere(np.triu(~dead, 1))).all()
        u, v = np.indices(dead.shape).reshape(2, -1)
        assert (marks[u, v] == dead.ravel()).all()
        other = np.empty(len(dead), dtype=np.int64)
        for row in range(len(dead)):
            assert (
                other[: write_alive(row, marks.bits, other)] == np.flatnonzero(~dead[row])
            ).all()


@pytest.mark.parametrize("seed", range(5))
def test_no_tour_violates_a_cut_and_the_cuts_found_are_violated(seed):
    graph = random_graph(seed, goals=6)
    rng = np.random.default_rng(seed)
    legs = np.argwhere(np.triu(np.isfinite(graph.costs), 1))
    program = HighsRelaxation(graph.cluster, legs, graph.costs[legs[:, 0], legs[:, 1]])
    point = program.solve(60.0)
    cuts = fractional_cuts(point.x, point.legs, point.y, graph.cluster)
    place = {tuple(leg): k for k, leg in enumerate(legs.tolist())}
    for cut in cuts:
        assert not cut.inside[0]
        inside = cut.inside[point.legs].all(axis=1)
        other = cut.inside & (graph.cluster != cut.cluster)
        assert point.y[inside].sum() > point.x[other].sum() + 1e-6
        for _ in range(50):
            order = rng.permutation(np.arange(1, graph.goal_count + 1))
            tour = [0, *(rng.choice(graph.members(c)) for c in order)]
            pairs = zip(tour, [*tour[1:], 0], strict=True)
            used = [place[tuple(sorted((int(a), int(b))))] for a, b in pairs]
            assert inside[used].sum() <= other[tour].sum()


@pytest.mark.parametrize("seed", range(5))
def test_a_cut_with_all_of_its_cluster_is_violated_most_and_no_less_than_with_a_part_of_it(seed):
    graph = random_graph(seed, goals=6, most=4)
    rng = np.random.default_rng(seed)
    legs, costs = first_legs(graph)
    point = HighsRelaxation(graph.cluster, legs, costs).solve(60.0)

    def crossing(inside):
        return point.y[inside[legs[:, 0]] ^ inside[legs[:, 1]]].sum()

    for _ in range(50):
        inside = rng.random(len(graph)) < 0.4
        inside[0] = False
        violation, cut = strongest_cut(inside, point.x, legs, point.y, graph.cluster)
        whole = {}
        for c in range(1, graph.goal_count + 1):
            of_c = graph.cluster == c
            whole[c] = 2.0 - crossing(inside | of_c)
            part = 2.0 * point.x[inside & of_c].sum() - crossing(inside)
            assert part <= whole[c] + 1e-7
        assert violation == pytest.approx(max(whole.values()), abs=1e-7)
        assert whole[cut.cluster] == pytest.approx(violation, abs=1e-7)
        assert (cut.inside == inside | (graph.cluster == cut.cluster)).all()


@pytest.mark.parametrize("seed", range(10))
def test_where_no_cut_of_whole_clusters_is_found_none_is_violated(seed):
    """Against all sets of goals; and those that are found are violated, and of whole clusters."""
    graph = random_graph(seed, goals=6, most=3)
    legs, costs = first_legs(graph)
    program = HighsRelaxation(graph.cluster, legs, costs)

    def crossing(goals):
        inside = np.isin(graph.cluster, goals)[legs]
        return point.y[inside[:, 0] ^ inside[:, 1]].sum()

    subsets = [s for k in range(1, 7) for s in itertools.combinations(range(1, 7), k)]
    for _ in range(20):
        point = program.solve(60.0)
        cuts = goal_cuts(point.legs, point.y, graph.cluster)
        least = min(crossing(s) for s in subsets)
        assert bool(cuts) == (least < 2.0 - MIN_VIOLATION)
        for cut in cuts:
            goals = np.unique(graph.cluster[cut.inside])
            assert (cut.inside == np.isin(graph.cluster, goals)).all()
            assert cut.cluster in goals
            assert crossing(goals) < 2.0 - MIN_VIOLATION
        if not cuts:
            return
        program.add_cuts(cuts)
    raise AssertionError("no end of cuts")


@given(st.integers(0, 100_000), st.integers(3, 12), st.integers(1, 4))
@settings(max_examples=150, deadline=None)
def test_goals_joined_by_whole_edges_hide_no_violated_set(seed, goals, mixed):
    rng = np.random.default_rng(seed)
    between = np.zeros((goals + 1, goals + 1))
    for _ in range(mixed):  # each a few cycles through all goals and the base, with weights alike
        order, at = rng.permutation(goals + 1), 0
        while at < goals + 1:
            size = goals + 1 - at if goals + 1 - at < 4 else int(rng.integers(2, goals - at))
            cycle = order[at : at + size]
            np.add.at(between, (cycle, np.roll(cycle, -1)), 1.0 / mixed)
            at += size
    between += between.T
    np.fill_diagonal(between, 0.0)
    legs = np.argwhere(np.triu(between) > 0.0)
    y = between[legs[:, 0], legs[:, 1]]
    cluster = np.arange(goals + 1)
    cuts = goal_cuts(legs, y, cluster)
    for cut in cuts:
        assert cut.inside[cut.cluster]
        assert not cut.inside[0]
        u, v = cut.inside[legs].T
        assert y[u ^ v].sum() < 2.0 - 1e-5
    sets = np.array(list(itertools.product([False, True], repeat=goals)), dtype=bool)[1:]
    sets = np.hstack([np.zeros((len(sets), 1), dtype=bool), sets])
    least = ((sets[:, legs[:, 0]] ^ sets[:, legs[:, 1]]) @ y).min()
    assert bool(cuts) == (least < 2.0 - MIN_VIOLATION)


def test_strings_of_whole_edges_are_joined_and_the_base_to_nothing():
    tail, head = np.array([0, 1, 2, 3, 4, 5]), np.array([1, 2, 3, 4, 5, 0])
    capacity = np.array([1.0, 1.0, 1.0, 0.5, 1.0, 1.0])
    assert contracted(6, Edges(tail, head, capacity), 0).tolist() == [0, 1, 1, 1, 2, 2]
    # 0.5 is all that others of either carry, but not of both
    ring = Edges(np.array([0, 1, 2, 1]), np.array([1, 2, 3, 3]), np.full(4, 0.5))
    pair = contracted(4, ring, 0)
    assert pair.tolist() == [0, 1, 2, 2]


@pytest.mark.parametrize("seed", range(5))
def test_prices_are_the_same_to_the_bit_however_they_are_summed_and_from_either_end(seed):
    graph = random_graph(seed, goals=6, most=4)
    rng = np.random.default_rng(seed)
    n = len(graph)
    cuts = [Cut(rng.random(n) < 0.5, 1 + k % 6) for k in range(12)]
    duals = duals_of_relaxation(rng.normal(size=7), rng.random(12), cuts, graph.cluster)
    none = ~np.isfinite(graph.costs)
    all_of_them = row_prices(Prices(costs_of(graph), DeadLegs(none), graph.cluster, cuts, duals))
    assert (all_of_them == all_of_them.T).all()
    for u, v in np.argwhere(np.triu(~none, 1))[::7].tolist():
        dead = np.ones_like(none)
        dead[u, v] = dead[v, u] = False
        alone = Prices(costs_of(graph), DeadLegs(dead), graph.cluster, cuts, duals)
        assert row_prices(alone)[u, v] == row_prices(alone)[v, u] == all_of_them[u, v]
        assert alone.reduced_costs(np.array([[u, v]])) == all_of_them[u, v]
        shared = sum(duals.cut[k] for k, c in enumerate(cuts) if c.inside[u] and c.inside[v])
        expected = graph.costs[u, v] - duals.degree[u] - duals.degree[v] - shared
        assert all_of_them[u, v] == pytest.approx(expected)


def row_prices(prices):
    """(V, V) reduced costs row by row; inf where a leg is dead."""
    terms = prices._terms
    n = len(terms.cluster)
    out = np.full((n, n), np.inf)
    other, price, room = np.empty(n, np.int64), np.empty(n), np.zeros(max(n, len(terms.weight)))
    for u in range(n):
        count = reduced_costs_at(u, terms, other, price, room)
        out[u, other[:count]] = price[:count]
        assert not room.any()
    return out


def test_legs_that_got_longer_since_are_looked_for_again_where_there_may_be_more():
    """All legs of negative price are given in the end, whatever few are given at a time."""
    graph = random_graph(3, goals=6, most=4)
    costs = graph.costs.copy()
    duals = duals_of_relaxation(np.full(7, 0.4), np.zeros(0), [], graph.cluster)
    policy = PricingPolicy(candidates_per_vertex=2)
    prices = Prices(costs, DeadLegs.missing(costs), graph.cluster, [], duals, policy=policy)
    legs, cost = first_legs(graph)
    negative = {tuple(leg) for leg in legs[cost < 0.8 - 1e-9].tolist()}
    seen = set()
    while len(found := prices.most_negative(1e-9)[0]):
        assert not seen & {tuple(leg) for leg in found.tolist()}
        seen |= {tuple(leg) for leg in found.tolist()}
        u, v = found.T
        costs[u, v] = costs[v, u] = 1e4
    assert len(seen) > 20
    assert seen == negative


def test_components_are_told_apart():
    legs = np.array([[0, 1], [2, 3], [3, 4]])
    count, label = components(np.array([1.0, 1, 1, 1, 1, 0]), legs, np.array([1.0, 0.5, 0.5]))
    assert count == 2
    assert label[5] == -1
    assert label[0] == label[1] != label[2] == label[3] == label[4]


@pytest.mark.parametrize("backend", BACKENDS)
def test_at_the_time_limit_there_is_a_tour_a_bound_and_no_process_left(backend):
    graph = TautRoadmap(random_world(0, goals=20, tether=350.0)).to_travel_graph()
    graph.costs  # noqa: B018 - not part of what is timed
    begin = time.monotonic()
    result = solve(graph, time=0.6, params={"backend": backend, "search_rounds": 2})
    assert time.monotonic() - begin < 0.6 + 2.0
    assert graph.is_tour(result.tour)
    assert 0.0 <= result.lower_bound <= result.length
    if result.status is not Status.OPTIMAL:
        assert result.status is Status.FEASIBLE
    assert [p for p in psutil.Process().children(recursive=True) if "cbc" in p.name()] == []


def test_ctrl_c_gives_the_best_tour_so_far():
    graph = TautRoadmap(random_world(0, goals=15, tether=300.0)).to_travel_graph()

    def interrupt(row):
        if row.stage == "root":
            raise KeyboardInterrupt

    result = solve(graph, on_progress=interrupt, params={"search_rounds": 0})
    assert graph.is_tour(result.tour)
    assert result.status in (Status.FEASIBLE, Status.OPTIMAL)


def test_a_warm_start_is_never_made_worse():
    graph = random_graph(3, goals=6)
    best = solve(graph)
    again = solve(graph, warm_start=best.tour, time=1e-3)
    assert again.length <= best.length * (1 + 1e-12)


@pytest.mark.parametrize("seed", [0, 1])
def test_same_seed_same_answer(seed):
    graph = random_graph(seed, goals=6)
    a = solve(graph, rng=np.random.default_rng(5))
    b = solve(graph, rng=np.random.default_rng(5))
    assert (a.tour, a.length, a.lower_bound) == (b.tour, b.length, b.lower_bound)


def test_the_backends_agree_on_a_real_graph():
    graph = TautRoadmap(random_world(3, goals=8, tether=280.0)).to_travel_graph()
    a, b = (solve(graph, params={"backend": k}) for k in BACKENDS)
    assert a.status is b.status is Status.OPTIMAL
    assert a.length == pytest.approx(b.length, rel=2e-6)


@pytest.mark.parametrize("seed", range(12))
def test_the_certificate_in_exact_rationals_is_no_lower_than_the_bound_claimed(seed):
    """`ROUNDING` covers what floating point can lose, for the LP's duals and for wild ones."""
    graph = random_graph(seed, goals=3 + seed % 4)
    legs = np.argwhere(np.triu(np.isfinite(graph.costs), 1))
    program = HighsRelaxation(graph.cluster, legs, graph.costs[legs[:, 0], legs[:, 1]])
    for _ in range(6):
        point = program.solve(60.0)
        cuts = fractional_cuts(point.x, point.legs, point.y, graph.cluster)
        if not cuts:
            break
        program.add_cuts(cuts)
    duals = program.solve(60.0).duals
    rng = np.random.default_rng(seed)
    best = brute(graph)
    for scale in (0.0, 1e-3, 1.0, 1e6):
        shaken = type(duals)(
            duals.cluster + scale * rng.normal(size=duals.cluster.shape),
            duals.degree + scale * rng.normal(size=duals.degree.shape),
            np.minimum(duals.cut + scale * rng.normal(size=duals.cut.shape), 0.0),
        )
        exact = exact_bound(graph.costs, graph.cluster, program.cuts, shaken)
        claimed = priced(graph, program.cuts, shaken).bound
        assert claimed <= exact
        assert float(exact) - claimed <= 1e-9 * max(1.0, scale)
        assert exact <= best * (1 + 1e-12)


def test_a_long_tether_is_solved_without_measuring_most_legs_where_that_takes_long(monkeypatch):
    problem = far_world(0, goals=5, tether_length=500.0)
    bound_legs_first(monkeypatch)
    lazy, whole = travel_graph(problem), travel_graph(problem)
    whole.costs  # noqa: B018
    assert len(whole) > CostPolicy().max_measured_vertices
    asked = []
    lengths = lazy.oracle.lengths

    def count(vertices, asked_for=None, clock=None):
        out = lengths(vertices, asked_for, clock)
        asked.append(out.size // 2 if asked_for is None else int(asked_for.sum()) // 2)
        return out

    lazy.oracle.lengths = count
    a, b = solve(lazy), solve(whole)
    assert a.status is b.status is Status.OPTIMAL
    assert a.length == pytest.approx(b.length, rel=2e-6)
    assert sum(asked) < 0.2 * len(whole) ** 2 / 2


def test_legs_that_an_lp_uses_are_measured_and_no_others(monkeypatch):
    bound_legs_first(monkeypatch)
    graph = travel_graph(far_world(0, goals=5, tether_length=500.0))
    costs = CostMatrix(graph)
    bounds = costs.values.copy()
    goals = graph.cluster[:, None] != graph.cluster[None, :]
    legs = np.argwhere(np.triu(goals, 1) & ~costs.exact)[:: len(bounds)]
    assert costs.measure_legs(legs)
    assert not costs.measure_legs(legs)
    u, v = legs.T
    np.testing.assert_allclose(costs.values[u, v], graph.costs[u, v], rtol=1e-12)
    assert (costs.values[u, v] > bounds[u, v] + 1e-3).any()
    assert (costs.values == costs.values.T).all()
    others = ~costs.exact
    np.testing.assert_array_equal(costs.values[others], bounds[others])


def test_no_leg_comes_into_an_lp_that_is_only_bounded(monkeypatch):
    seen = []
    few = root.Root._cheapest_per_vertex

    def note(self, legs, price):
        if self.costs.exact is not None and len(legs):
            seen.append(bool(self.costs.exact[legs[:, 0], legs[:, 1]].all()))
        return few(self, legs, price)

    monkeypatch.setattr(root.Root, "_cheapest_per_vertex", note)
    bound_legs_first(monkeypatch)
    assert solve(travel_graph(far_world(0, goals=5, tether_length=500.0))).status is Status.OPTIMAL
    assert seen
    assert all(seen)


@pytest.mark.parametrize("at_once", [True, False])
@pytest.mark.parametrize("rounded_from", [10, 300])
def test_rounded_costs_prove_the_same(monkeypatch, rounded_from, at_once):
    problem = far_world(0, goals=7, tether_length=450.0)
    plain = solve(travel_graph(problem))
    if not at_once:
        bound_legs_first(monkeypatch)
    policy = CostPolicy(
        max_measured_vertices=5, max_double_vertices=rounded_from, block_rows=100, block_legs=70
    )
    graph = travel_graph(problem)
    costs = CostMatrix(graph, policy=policy)
    assert costs.rounded
    assert costs.values.dtype == np.float32
    most = travel_graph(problem).costs if at_once else graph.lower_bounds()
    assert (costs.values[1:, 1:] <= most[1:, 1:]).all()
    assert (costs.exact is None) == at_once
    found = solve(graph, {"policy.gtsp.costs": policy})
    assert found.status is plain.status is Status.OPTIMAL
    assert found.length == pytest.approx(plain.length, rel=2e-6)
    assert found.length == pytest.approx(graph.tour_length(found.tour), rel=1e-12)
    assert found.lower_bound <= plain.length * (1 + 1e-9)


def test_what_is_measured_of_rounded_costs_is_as_long_as_it_is(monkeypatch):
    policy = CostPolicy(
        max_measured_vertices=5, max_double_vertices=10, block_rows=50, block_legs=30
    )
    bound_legs_first(monkeypatch)
    graph = travel_graph(far_world(0, goals=5, tether_length=400.0))
    costs, rng = CostMatrix(graph, policy=policy), np.random.default_rng(0)
    asked = rng.random(costs.values.shape) < 0.5
    asked = (asked | asked.T) & np.isfinite(costs.values)
    costs.measure_all(asked)
    held, known = costs.values[asked], graph.costs[asked]
    assert (held <= known).all()
    assert (held >= known * (1 - 2e-7)).all()
    base = np.zeros_like(asked)
    base[0] = base[:, 0] = True
    assert np.isinf(costs.values[~(asked | base)]).all()
    keep = np.arange(len(costs)) % 7 > 0
    keep[0] = True
    before = costs.values.copy()
    costs.restrict(keep)
    assert (costs.values == before[np.ix_(keep, keep)]).all()
    costs.restrict(np.arange(len(costs)) < 5)
    assert not costs.rounded
    lengths = graph.costs[np.ix_(costs.vertices, costs.vertices)]
    held = np.isfinite(costs.values)
    np.testing.assert_allclose(costs.values[held], lengths[held], rtol=1e-12)


@given(
    st.lists(st.floats(0.0, 1e6) | st.just(float("inf")), min_size=9, max_size=9),
    st.lists(st.booleans(), min_size=3, max_size=3),
)
def test_rounding_is_down_and_squeezing_keeps_what_is_kept(numbers, keep):
    matrix = np.array(numbers).reshape(3, 3)
    rounded = rounded_down(matrix)
    assert (rounded <= matrix).all()
    assert (rounded >= matrix * (1 - 2e-7) - 1e-40).all()
    kept = np.array(keep)
    np.testing.assert_array_equal(
        cost_matrix.squeezed(matrix.copy(), kept), matrix[np.ix_(kept, kept)]
    )


def test_with_many_classes_of_few_goals_a_bound_comes_before_all_legs_are_bounded(monkeypatch):
    graph = travel_graph(far_world(0, goals=8, tether_length=500.0))
    held = []

    class OfSome(CostMatrix):
        def __init__(self, part, **policy):
            if len(part) == len(graph):
                raise RunStopped
            held.append(len(part))
            super().__init__(part, **policy)

    module = sys.modules["netsp.mip.mip_solver"]  # the function of that name hides it
    monkeypatch.setattr(module, "CostMatrix", OfSome)
    gtsp = GtspPolicy(proof_search=ProofSearchPolicy(min_core_ratio=2.0))
    assert len(graph) > gtsp.costs.max_measured_vertices
    run = MipRun(graph, Limits(), policy=MipPolicy(core_classes=10, gtsp=gtsp))
    found = run.solve("highs", None, walks=True)
    assert held
    assert found.status is Status.FEASIBLE
    assert found.lower_bound > 0.5 * found.length


def test_with_many_goals_their_bound_comes_first_and_the_proof_is_the_same():
    graph = travel_graph(far_world(1, goals=12, tether_length=200.0))
    plain = solve(graph)
    assert "goals" not in {row.stage for row in plain.trace}
    first = solve(graph, {"policy": MipPolicy(many_goals=12)})
    begun = [row for row in first.trace if row.stage == "goals"]
    assert 0.0 < begun[0].bound.length <= plain.length * (1 + 1e-9)
    assert first.status is plain.status is Status.OPTIMAL
    assert first.length == pytest.approx(plain.length)


def test_the_matrices_of_a_proof_go_when_it_ends(monkeypatch):
    made = []
    module = sys.modules["netsp.mip.mip_solver"]  # the function of that name hides it

    class Noted(CostMatrix):
        def __init__(self, graph, **policy):
            super().__init__(graph, **policy)
            made.append(weakref.ref(self))

    monkeypatch.setattr(module, "CostMatrix", Noted)
    gc.disable()
    try:
        found = solve(travel_graph(far_world(1, goals=25, tether_length=300.0)))
        left = [ref for ref in made if ref() is not None]
    finally:
        gc.enable()
    assert found.status is Status.OPTIMAL
    assert made
    assert not left


@given(
    st.lists(st.integers(0, 9) | st.floats(0.0, 9.0), min_size=36, max_size=36),
    st.integers(3, 6), st.booleans(),
)  # fmt: skip
def test_a_one_tree_is_no_longer_than_any_tour(numbers, n, hurried):
    half = np.triu(np.array(numbers).reshape(6, 6)[:n, :n], 1)
    lengths = half + half.T
    best = min(
        sum(lengths[a, b] for a, b in itertools.pairwise((0, *order, 0)))
        for order in itertools.permutations(range(1, n))
    )
    assert 0.0 <= one_tree_bound(lengths, lambda: hurried) <= best * (1 + 1e-9) + 1e-9


def test_one_trees_come_near_the_tour_of_many_places():
    place = np.random.default_rng(0).random((60, 2))
    lengths = np.hypot(*(place[:, None] - place[None]).transpose(2, 0, 1))
    apart = lengths + np.diag(np.full(60, np.inf))
    tour = solve(TravelGraph.from_costs(apart, range(60)))
    assert tour.status is Status.OPTIMAL
    assert one_tree_bound(lengths, lambda: False) >= 0.97 * tour.length


def test_between_goals_straight_lines_bound_legs_when_there_is_no_time():
    graph = travel_graph(far_world(0, goals=6, tether_length=300.0))
    hurried, whole = graph.distances_between_goals(lambda: True), graph.distances_between_goals()
    assert (hurried[~np.eye(7, dtype=bool)] > 0.0).all()
    assert (hurried <= whole * (1 + 1e-9)).all()
    legs = np.isfinite(graph.costs)
    among = whole[graph.cluster[:, None], graph.cluster[None, :]]
    assert (among[legs] <= graph.costs[legs] * (1 + 1e-9)).all()


def from_kernel():
    """Ctrl-C as it comes out of a compiled function that was called by another."""
    try:
        try:
            raise KeyboardInterrupt
        except KeyboardInterrupt as pressed:
            raise SystemError("returned a result with an exception set") from pressed
    except SystemError as inner:
        raise SystemError("returned a result with an exception set") from inner


def plainly():
    raise KeyboardInterrupt


@pytest.mark.parametrize("press", [plainly, from_kernel])
def test_ctrl_c_in_a_proof_over_goals_ends_the_proof_over_classes_too(monkeypatch, press):
    graph, calls = travel_graph(far_world(0, goals=8, tether_length=500.0)), []

    def relaxed(self):
        self.run.check()
        calls.append(len(self.costs))
        press()

    monkeypatch.setattr(root.Root, "_solve_lp", relaxed)
    found = solve(graph, {"policy.gtsp.proof_search.min_core_ratio": 2})
    assert calls == [9]  # base and goals
    assert found.status is Status.FEASIBLE
    assert graph.is_tour(found.tour)
    assert found.length == pytest.approx(graph.tour_length(found.tour))


def test_what_comes_of_something_else_than_ctrl_c_is_no_interrupt(monkeypatch):
    def cuts(*_):
        raise SystemError("of another kind")

    monkeypatch.setattr(root, "fractional_cuts", cuts)
    with pytest.raises(SystemError, match="another kind"):
        solve(travel_graph(far_world(0, goals=8, tether_length=300.0)))


def test_what_is_done_with_thousands_of_classes_only_proves_the_same_with_hundreds(monkeypatch):
    problem = far_world(1, goals=25, tether_length=300.0)
    plain = solve(travel_graph(problem))
    policy = MipPolicy(
        lp=LpPolicy(many_vertices=0, drop_interval=1),
        pricing=PricingPolicy(max_new_legs=40),
        schedule=SchedulePolicy(settle_share=0.05),
    )
    left = []
    drop = root.Root._drop_expensive_legs
    monkeypatch.setattr(
        root.Root,
        "_drop_expensive_legs",
        lambda self, *more: (drop(self, *more), left.append(self)),
    )
    lean = solve(travel_graph(problem), {"policy": policy})
    assert left
    assert plain.status is lean.status is Status.OPTIMAL
    assert lean.length == pytest.approx(plain.length, rel=2e-6)


def test_cuts_of_the_proof_over_goals_stay_in_the_program(monkeypatch):
    policy = MipPolicy(many_goals=5, cuts=CutPolicy(max_idle_rounds=1))
    ends = []
    proven = root.Root.steps

    def prove(self):
        began = self.lp.pool.permanent.sum()
        yield from proven(self)
        ends.append((began, self.lp.pool.permanent.sum(), len(self.lp.pool)))

    monkeypatch.setattr(root.Root, "steps", prove)
    solve(travel_graph(far_world(1, goals=25, tether_length=300.0)), {"policy": policy})
    began, left, cuts = ends[-1]
    assert 0 < began == left < cuts


def test_looking_at_prices_can_be_stopped_half_way():
    graph = travel_graph(far_world(0, goals=6, tether_length=400.0))
    vertices = len(graph)
    assert vertices > 10
    duals = HighsRelaxation(graph.cluster, *first_legs(graph)).solve(None).duals
    dead, seen = DeadLegs.missing(graph.costs), []

    def stop():
        seen.append(1)
        if len(seen) > 2:
            raise RunStopped

    policy = PricingPolicy(rows_per_task=max(1, vertices // 6))
    with pytest.raises(RunStopped):
        Prices(costs_of(graph), dead, graph.cluster, [], duals, stop, policy)


def first_legs(graph):
    """All legs and their costs."""
    legs = np.argwhere(np.triu(np.isfinite(graph.costs), 1))
    return legs, graph.costs[legs[:, 0], legs[:, 1]]


@pytest.mark.parametrize("seed", range(3))
def test_a_tour_that_the_relaxation_finds_is_kept_where_too_much_is_left_to_be_searched(
    seed, monkeypatch
):
    problem = far_world(seed, goals=7, tether_length=400.0)
    plain = solve(travel_graph(problem))
    monkeypatch.setattr(searching.SearchingRun, "search", lambda *_: None)
    found = solve(travel_graph(problem), {"policy.gtsp.proof_search.max_whole_search": 1})
    assert found.status is plain.status is Status.OPTIMAL
    assert found.length == pytest.approx(plain.length, rel=2e-6)
