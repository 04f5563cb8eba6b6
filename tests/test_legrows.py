"""Legs in rows: those that may be in a better tour and no others, and as good as a matrix."""

import functools
import importlib

import numpy as np
import pytest

from netsp import Problem, Status, solve_graph, travel_graph
from netsp import solve as solve_problem
from netsp.gtsp import cost_matrix
from netsp.gtsp.cost_matrix import CostMatrix
from netsp.gtsp.gtsp_policy import CostPolicy, GtspPolicy, ProofSearchPolicy
from netsp.gtsp.limits import Limits
from netsp.gtsp.nearest_index import NearestIndex
from netsp.gtsp.sparse_costs import SparseCosts
from netsp.mip.cost_fixing import max_leg_costs, surviving_legs
from netsp.mip.cover_costs import ClassCovers, PathCovers
from netsp.mip.covers import refine_covers
from netsp.mip.cuts import Cut
from netsp.mip.deadlegs import DeadLegs
from netsp.mip.mip_policy import CoverPolicy, MipPolicy
from netsp.mip.parity_cuts import odd_numbers
from netsp.mip.prices import Prices
from netsp.mip.program import duals_of_relaxation
from netsp.model.problem import State
from netsp.plan.random_worlds import random_world
from netsp.roadmap.class_alternatives import graph_of_choices
from netsp.roadmap.from_state import graph_from_state
from netsp.roadmap.roadmap_policy import LegPolicy, RoadmapPolicy
from netsp.roadmap.taut import TautRoadmap
from tests.cut_points import small
from tests.travel_graphs import random_graph

SOLVE = importlib.import_module("netsp.mip.mip_solver")  # the package has a function of that name
NO_TOUR = np.zeros(0, dtype=np.int64)


def in_blocks(costs, rng, size):
    """Rows of a matrix, in any order, and some at a time."""
    order = rng.permutation(len(costs))
    for first in range(0, len(order), size):
        rows = order[first : first + size]
        yield rows, costs[rows].astype(np.float32)


def rows_of(costs, rng, size=7):
    """All legs of a matrix."""
    everywhere = np.zeros(len(costs), dtype=np.int64)
    return SparseCosts(
        len(costs), in_blocks(costs, rng, size), everywhere, np.full((1, 1), np.inf), NO_TOUR
    )


def matrix_of(rows):
    """(V, V) costs; inf where a leg is gone."""
    every = np.arange(len(rows))
    u, v = np.meshgrid(every, every, indexing="ij")
    return rows.costs_of(u.ravel(), v.ravel()).reshape(len(rows), -1)


def some_costs(rng, size=40):
    """Symmetric, of single precision, some of them infinite."""
    costs = rng.uniform(1.0, 9.0, (size, size)).astype(np.float32).astype(float)
    costs[rng.random((size, size)) < 0.3] = np.inf
    costs = np.minimum(costs, costs.T)
    np.fill_diagonal(costs, np.inf)
    return costs


@pytest.mark.parametrize("size", [1, 7, 100])
def test_what_costs_more_than_its_cells_allow_is_gone_but_for_the_legs_of_the_tour(size):
    rng = np.random.default_rng(size)
    costs = some_costs(rng)
    own = rng.integers(-1, 5, len(costs))
    longest = rng.uniform(2.0, 9.0, (5, 5))
    longest = np.minimum(longest, longest.T)
    longest[2, 3] = longest[3, 2] = -np.inf
    tour = rng.permutation(len(costs))[:9]
    rows = SparseCosts(len(costs), in_blocks(costs, rng, size), own, longest, tour)
    kept = (costs <= longest[own][:, own]) & (own >= 0)[:, None] & (own >= 0)
    kept[tour, np.roll(tour, 1)] = kept[np.roll(tour, 1), tour] = True
    assert 0 < kept.sum() < np.isfinite(costs).sum()
    assert (matrix_of(rows) == np.where(kept, costs, np.inf)).all()


def test_rows_ask_for_room_before_they_grow(monkeypatch):
    rng = np.random.default_rng(0)
    costs = some_costs(rng)
    asked = []
    monkeypatch.setattr(
        "netsp.gtsp.sparse_costs.check_available",
        lambda size, what, advice: asked.append((size, len(what))),
    )
    rows_of(costs, rng)
    assert sum(size for size, _ in asked) == 8.0 * np.isfinite(costs).sum()


def test_rows_are_a_matrix_of_which_legs_and_vertices_are_let_go():
    rng = np.random.default_rng(0)
    costs = some_costs(rng)
    rows = rows_of(costs, rng)
    own, dead = rng.integers(0, 4, len(costs)), rng.random((4, 4)) < 0.3
    dead |= dead.T
    rows.add_above(own, dead)
    costs[dead[own][:, own]] = np.inf
    assert (matrix_of(rows) == costs).all()
    for share in (0.1, 0.7):  # with the second they are packed anew
        gone = rng.random(len(costs)) < share
        rows.add_vertices(gone)
        costs[gone] = costs[:, gone] = np.inf
        assert (matrix_of(rows) == costs).all()
        assert (rows.with_legs() == np.isfinite(costs).any(axis=1)).all()
        assert rows.left == np.isfinite(costs).sum() // 2
        assert (rows.legs_left() == np.argwhere(np.triu(np.isfinite(costs)))).all()
        u, v = rng.integers(0, len(costs), (2, 50))
        assert (rows[u, v] == np.isinf(costs[u, v])).all()
    keep = rng.random(len(costs)) < 0.8
    rows.restrict(keep)
    assert (matrix_of(rows) == costs[np.ix_(keep, keep)]).all()


def test_the_nearest_legs_are_those_of_the_matrix():
    rng = np.random.default_rng(1)
    costs = some_costs(rng)
    costs[5] = costs[:, 5] = np.inf
    rows = rows_of(costs, rng)
    near = rows.nearest_legs(3)
    for u in range(len(costs)):
        some = np.sort(costs[u])[:3]
        of_u = near[near[:, 0] == u]
        assert sorted(costs[u, of_u[:, 1]]) == some[np.isfinite(some)].tolist()


@pytest.mark.parametrize("seed", range(4))
def test_prices_over_rows_are_those_over_a_matrix_and_rule_out_the_same(seed):
    graph, rng = random_graph(seed, goals=6, most=4), np.random.default_rng(seed)
    costs = graph.costs.astype(np.float32)
    cuts = [Cut(rng.random(len(graph)) < 0.5, 1 + k % 6) for k in range(12)]
    duals = duals_of_relaxation(rng.normal(size=7), rng.random(12), cuts, graph.cluster)
    marks, rows = DeadLegs.missing(costs), rows_of(costs, rng)
    with_marks = Prices(costs, marks, graph.cluster, cuts, duals)
    in_rows = Prices(cost_matrix.NO_VALUES, rows, graph.cluster, cuts, duals)
    assert in_rows.bound == with_marks.bound
    cutoff = with_marks.bound + 3.0
    legs = marks.legs_left()
    assert (in_rows.reduced_costs(legs) == with_marks.reduced_costs(legs)).all()
    before = rows.left
    in_rows.fix_out(cutoff)
    with_marks.fix_out(cutoff)
    assert (matrix_of(rows) == np.where(marks.matrix(), np.inf, costs)).all()
    assert 0 < rows.left < before
    for a, b in zip(in_rows.most_negative(1e-9), with_marks.most_negative(1e-9), strict=True):
        assert (a == b).all()
    gone = np.argwhere(np.isinf(matrix_of(rows)) & np.isfinite(costs))
    assert np.isinf(in_rows.reduced_costs(gone)).all()


def test_what_lies_nearest_is_so_along_legs_that_were_let_go_too():
    never_a_matrix = CostPolicy(max_double_vertices=0)
    graph, rng = travel_graph(small(3, tether_length=150.0)), np.random.default_rng(0)
    costs, asked, find = graph.costs_rounded(np.arange(len(graph))), [], graph.costs_in_blocks

    def noted(vertices, rows):
        asked.append(len(rows))
        return find(vertices, rows)

    graph.costs_in_blocks = noted
    least = np.full((1, 1), -np.inf)  # no leg is left
    rows = SparseCosts(len(graph), find(), np.zeros(len(graph), dtype=np.int64), least, NO_TOUR)
    held = CostMatrix(graph, rows, policy=never_a_matrix)
    some = rng.permutation(len(graph))[:30]
    for fresh in 30, 10, 0:
        near = held.nearest_among(some)
        left = costs[np.ix_(held.vertices, held.vertices)]
        every = np.arange(len(held))
        assert (left[every, some[near]] == left[:, some].min(axis=1)).all()
        assert asked[-1:] == [fresh] or fresh == 0
        if fresh == 30:
            others = np.setdiff1d(every, some)
            some = np.concatenate([some[:20], rng.permutation(others)[:10]])
        else:
            keep = rng.random(len(held)) < 0.7
            keep[some] = True
            held.restrict(keep)
            some = np.cumsum(keep)[some] - 1
    assert asked == [30, 10]


def over_ways(seed, coarse_covers=3):
    """A small world, its best tour, and what covers of ways prove with a tour 2 % longer."""
    graph = travel_graph(small(seed, tether_length=150.0))
    best = solve_graph(graph, "auto")
    ways = graph.parity_oracle(lambda: False)
    odd = odd_numbers(graph.labels, ways.barriers)
    stops = [(int(graph.cluster[v]), odd[v]) for v in best.tour]
    seen = []

    def refine_costs(over, length):
        seen.append((over, length))
        rows = surviving_legs(graph, over, length, best.tour, odd)
        return ClassCovers(rows, graph.cluster, odd)

    length = 1.02 * best.length
    policy = MipPolicy(covers=CoverPolicy(coarse_covers=coarse_covers))
    found = refine_covers(
        PathCovers(ways, np.inf), stops, length, Limits(), refine_costs=refine_costs, policy=policy
    )
    return graph, best, odd, seen, found


@pytest.mark.parametrize("seed", range(4))
def test_covers_go_on_where_a_cell_has_no_class_left(seed, monkeypatch):
    emptied, find = [], surviving_legs

    def fewer(graph, over, length, tour, odd):
        rows = find(graph, over, length, tour, odd)
        others = (graph.cluster == 1) & ~np.isin(np.arange(len(graph)), tour)
        rows.add_vertices(others)
        emptied.append(set(over.cells.cells_of(graph.cluster, odd)[others].tolist()))
        return rows

    monkeypatch.setattr("tests.test_legrows.surviving_legs", fewer)
    _, best, _, seen, found = over_ways(seed, coarse_covers=2)
    assert found.bound <= 1.02 * best.length
    assert len(emptied) == len(seen)


def shortest_along(graph):
    """Return the (V, V) lengths of the shortest tours along each leg, by dynamic programming.

    A tour along a leg is a path from the base through some goals to its one end, the leg, and a
    path from its other end through all other goals to the base.
    """
    n, whole = graph.goal_count, 2**graph.goal_count - 1
    members = [graph.members(c) for c in range(1, n + 1)]
    reach = np.full((whole + 1, len(graph)), np.inf)
    reach[0, 0] = 0.0
    for goals in range(1, whole + 1):
        for c in np.flatnonzero(goals >> np.arange(n) & 1):
            before = reach[goals & ~(1 << c)]
            last = np.flatnonzero(np.isfinite(before))
            detours = before[last, None] + graph.costs[np.ix_(last, members[c])]
            reach[goals, members[c]] = detours.min(axis=0, initial=np.inf)
    rest = np.full((len(graph), len(graph)), np.inf)
    for goals in range(whole + 1):
        one, other = (np.flatnonzero(np.isfinite(reach[s])) for s in (goals, whole & ~goals))
        both = reach[goals, one, None] + reach[whole & ~goals, other]
        rest[np.ix_(one, other)] = np.minimum(rest[np.ix_(one, other)], both)
    return graph.costs + rest


@pytest.mark.parametrize("seed", range(6))
def test_no_leg_of_a_better_tour_is_let_go(seed):
    graph, best, odd, seen, found = over_ways(seed, coarse_covers=1)
    ((over, length),) = seen
    assert over.bound < length
    rows = surviving_legs(graph, over, length, NO_TOUR, odd)
    left = matrix_of(rows)
    assert np.isfinite(left).sum() < np.isfinite(graph.costs).sum()
    gone = np.argwhere(np.triu(np.isinf(left) & np.isfinite(graph.costs)))
    own = over.cells.cells_of(graph.cluster, odd)
    u, v = gone.T
    excess = graph.costs[u, v] - max_leg_costs(over, length)[own[u], own[v]]
    assert (excess > 0.0).all()
    shortest = shortest_along(graph)
    assert shortest.min() == pytest.approx(best.length)
    assert len(gone) > 60
    assert shortest[u, v].min() >= length * (1.0 - 1e-7)
    assert found.bound <= best.length * (1.0 + 1e-6)
    assert np.isfinite(left[list(best.tour), np.roll(best.tour, 1)]).all()


@pytest.mark.parametrize("seed", range(3))
def test_what_a_leg_may_cost_is_no_less_than_it_costs_in_tours_as_short(seed):
    graph, best, odd, seen, _ = over_ways(seed)
    for over, length in seen:
        longest = max_leg_costs(over, length)
        own = over.cells.cells_of(graph.cluster, odd)
        tour = np.array(best.tour)
        cost = graph.costs[tour, np.roll(tour, 1)]
        assert (cost <= longest[own[tour], own[np.roll(tour, 1)]] + 1e-9).all()


@pytest.fixture
def rows_from_the_start(monkeypatch):
    """Legs of small graphs are held in rows, until few classes are left."""
    # covers prove little, so that the program over the classes has something to do
    covers = CoverPolicy(min_classes=20, coarse_covers=1, max_cells=25, patience=0)
    made, restricted = [], []
    make, restrict = CostMatrix.__init__, SparseCosts.restrict

    def noted(self, graph, rows=None, **policy):
        made.append(rows is not None)
        make(self, graph, rows, **policy)

    def heard(self, keep):
        restricted.append(int(keep.sum()))
        restrict(self, keep)

    monkeypatch.setattr(CostMatrix, "__init__", noted)
    monkeypatch.setattr(SparseCosts, "restrict", heard)
    costs = CostPolicy(max_measured_vertices=10, max_double_vertices=20)
    gtsp = GtspPolicy(costs=costs, proof_search=ProofSearchPolicy(core_vertices=30))
    return made, restricted, MipPolicy(many_goals=5, covers=covers, gtsp=gtsp)


@pytest.mark.parametrize("seed", range(5))
def test_a_proof_over_rows_finds_the_optimum_of_one_over_a_matrix(
    seed, rows_from_the_start, monkeypatch
):
    made, _, policy = rows_from_the_start
    asked, find = [], NearestIndex.nearest

    def heard(self, vertices, some):
        asked.append(len(some))
        return find(self, vertices, some)

    monkeypatch.setattr(NearestIndex, "nearest", heard)
    problem = random_world(
        seed, goals=9 + seed, obstacles=6, side=80.0, radii=(4.0, 8.0), tether_length=150.0
    )
    graph = travel_graph(problem)
    expected = solve_graph(travel_graph(problem), "auto")
    found = solve_graph(graph, "mip", params={"policy": policy}, seed=seed)
    assert any(made)
    assert asked
    assert found.status is Status.OPTIMAL
    assert found.length == pytest.approx(expected.length, rel=1e-6)
    assert graph.estimate(len(graph)).seconds > 0


@functools.cache
def graphs_by_kind(policy=None):
    """Return travel graphs whose legs are those of another one, changed, by what changed them."""
    plain = small(3, goals=6, tether_length=150.0)
    goals = [g.model_dump() for g in plain.goals]
    for g in goals[:2]:
        g["choice"] = "either"
    choices = Problem.model_validate(plain.model_dump() | {"goals": goals})
    whole = solve_problem(plain)
    here = whole.tour[2]
    state = State(position=plain.goals[here.goal].position, signature=here.signature)
    left = tuple(plain.goals[v.goal] for v in whole.tour[3:])

    def build(problem):
        graph = TautRoadmap(problem, policy).to_travel_graph()
        graph.before = problem.precedences
        return graph

    return {
        "plain": build(plain),
        "with alternatives": graph_of_choices(choices, build),
        "from a state": graph_from_state(
            plain.model_copy(update={"goals": left, "state": state}), policy
        ),
        "without precedences": build(plain).unordered(),
    }


@pytest.mark.parametrize(
    "kind", ["plain", "with alternatives", "from a state", "without precedences"]
)
def test_legs_in_blocks_are_those_rounded_and_ways_no_longer(kind):
    count = len(graphs_by_kind()[kind])
    legs = LegPolicy(block_rows=5, max_block_legs=17 * count)
    graph = graphs_by_kind(RoadmapPolicy(legs=legs))[kind]
    with pytest.deprecated_call():
        assert graph.legs_in_blocks
    expected = graph.costs_rounded(np.arange(len(graph)))
    for asked in None, np.random.default_rng(0).permutation(len(graph))[:23]:
        seen = np.zeros(len(graph), dtype=int)
        for rows, costs in graph.costs_in_blocks(None, asked):
            seen[rows] += 1
            assert len(rows) <= 17
            assert costs.dtype == np.float32
            assert np.allclose(costs, expected[rows], rtol=3e-7)
        assert seen.sum() == (len(graph) if asked is None else 23)
        assert (seen[slice(None) if asked is None else asked] == 1).all()
    ways = graph.parity_oracle(lambda: False)
    assert graph.parity_oracle is not None
    odd = odd_numbers(graph.labels, ways.barriers)
    tower = PathCovers(ways, np.inf)
    cells = tower.cells(tuple(range(ways.barriers)))
    own = cells.cells_of(graph.cluster, odd)
    assert (own >= 0).all()
    least = tower.costs(cells)[own][:, own]
    finite = np.isfinite(expected)
    assert (least[finite] <= graph.costs[finite] + 1e-6).all()
    short = graph.costs < np.quantile(graph.costs[finite], 0.01)
    assert np.mean(least[short] > 0.9 * graph.costs[short]) > 0.5
