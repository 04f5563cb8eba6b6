"""Which obstacles covers tell apart next, and what they promise."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import solve_graph
from netsp.base.clock import Clock
from netsp.gtsp.limits import Limits
from netsp.gtsp.solver_run import RunStopped
from netsp.mip import covers
from netsp.mip.cover_bounds import Cells
from netsp.mip.cover_refinement import CoverRefinement, frustration
from netsp.mip.mip_policy import CoverPolicy
from netsp.mip.root import Root
from tests.cut_points import towers


def least_frustration(ends, excess, sides):
    """By all choices of sides."""
    choices = itertools.product(*[np.flatnonzero(s) for s in sides])
    k = np.arange(len(ends))
    return min(
        float(excess[k, (s := np.array(c))[ends[:, 0]] ^ s[ends[:, 1]]].sum()) for c in choices
    )


@st.composite
def signed_graphs(draw):
    """Legs between cells, what they cost more on a side and across, and sides of the cells."""
    m = draw(st.integers(2, 7))
    pairs = list(itertools.combinations(range(m), 2))
    ends = np.array(draw(st.lists(st.sampled_from(pairs), min_size=1, max_size=12, unique=True)))
    cost = st.floats(0.0, 5.0)
    excess = np.array([[draw(cost), draw(cost)] for _ in ends])
    side = st.sampled_from([(True, False), (False, True), (True, True)])
    return ends, excess, np.array([draw(side) for _ in range(m)])


@settings(max_examples=200, deadline=None)
@given(signed_graphs())
def test_frustration_is_no_less_than_the_least_of_all_choices_of_sides(graph):
    found = frustration(*graph, 20)
    assert least_frustration(*graph) - 1e-9 <= found <= graph[1].max(axis=1).sum() + 1e-9


@settings(max_examples=100, deadline=None)
@given(signed_graphs(), st.randoms(use_true_random=False))
def test_what_goes_around_nothing_is_not_frustrated(graph, chance):
    ends, excess, sides = graph
    side = np.array([chance.choice(np.flatnonzero(s)) for s in sides])
    excess[np.arange(len(ends)), side[ends[:, 0]] ^ side[ends[:, 1]]] = 0.0
    assert frustration(ends, excess, sides, 20) == 0.0
    one_sided = np.arange(2) == side[:, None]
    assert frustration(ends, excess, one_sided, 20) == 0.0
    # where legs tell which side their ends are on, a tree of them does
    excess[np.arange(len(ends)), 1 - (side[ends[:, 0]] ^ side[ends[:, 1]])] = 1.0
    assert frustration(ends, excess, np.ones_like(sides), 20) == 0.0


def test_once_around_costs_the_cheapest_leg_of_the_ring():
    ring = np.array([(0, 1), (1, 2), (2, 3), (0, 3)])
    excess = np.array([(0.0, 5.0), (0.0, 3.0), (0.0, 7.0), (6.0, 0.0)])
    both = np.ones((4, 2), dtype=bool)
    assert frustration(ring, excess, both, 20) == 3.0
    # the ends of the leg that would give way have only one side
    both[1:3, 1] = False
    assert frustration(ring, excess, both, 20) == 5.0


@pytest.mark.parametrize("seed", range(4))
def test_legs_by_parity_are_those_between_sides_of_the_cover_above(seed):
    _, _, *both = towers(seed)
    for tower in both:
        cells = tower.cells((0,))
        m = len(cells.cluster)
        ends = np.array([
            (a, b) for a, b in itertools.combinations(range(m), 2)
            if cells.cluster[a] != cells.cluster[b]
        ])  # fmt: skip
        found = tower.costs_by_parity(cells, ends)
        np.testing.assert_array_equal(
            found.min(axis=2), np.repeat(tower.costs(cells)[*ends.T], tower.barriers).reshape(
                len(ends), -1
            )
        )  # fmt: skip
        for i in range(1, tower.barriers):
            split = tower.cells((0, i))
            costs, own = tower.costs(split), split.cells_below(cells)
            least = np.full((m, m, 2), np.inf)
            side = split.code >> 1 & 1
            where = own[:, None], own[None, :], side[:, None] ^ side[None, :]
            np.minimum.at(least, where, costs)
            there = np.isfinite(least[*ends.T])
            assert (found[:, i][there] <= least[*ends.T][there]).all()
            if tower is both[0]:
                np.testing.assert_array_equal(found[:, i], least[*ends.T])


class TwoBarriers:
    """A ring of three goals around the second obstacle, that the first is no part of; both have
    two sides for each goal, and a third, that no leg crosses, has too."""

    barriers = 3

    def cells(self, barriers):
        goals = np.repeat(np.arange(1, 4), 1 << len(barriers))
        codes = np.tile(np.arange(1 << len(barriers)), 3)
        return Cells(barriers, np.insert(goals, 0, 0), np.insert(codes, 0, 0))

    def costs_by_parity(self, cells, ends):
        out = np.empty((len(ends), 3, 2))
        out[:] = 1.0, 4.0
        out[-1, 1] = 4.0, 1.0
        return out


def test_the_obstacle_that_a_point_goes_around_is_told_apart_first():
    tower = TwoBarriers()
    ring = np.array([(1, 2), (2, 3), (1, 3)])
    splits = CoverRefinement(tower, CoverPolicy(max_cells=100))
    assert splits.next_barriers(tower.cells(()), ring, np.ones(3), gap=10.0) == [1]
    # with no more cells than there may be
    few_cells = CoverRefinement(tower, CoverPolicy(max_cells=6))
    assert few_cells.next_barriers(tower.cells(()), ring, np.ones(3), gap=10.0) == []
    # what promised once is believed after a point that goes around nothing
    assert splits.next_barriers(tower.cells((0,)), ring[:2], np.ones(2), gap=10.0) == [1]


@pytest.mark.parametrize("much", [True, False])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_better_tour_that_is_told_is_gone_on_with(seed, much, monkeypatch):
    """But not one by so little that the legs that were ruled out may be its own."""
    graph, odd, tower, _ = towers(seed)
    best = list(solve_graph(graph, "auto").tour)
    other = [best[0], best[2], best[1], *best[3:]]
    given = graph.tour_length(other)
    told_length = graph.tour_length(best) if much else given * (1.0 - 1e-9)
    assert told_length < given < np.inf
    levels = []

    class Noted(covers._Level):
        def __init__(self, *args):
            super().__init__(*args)
            levels.append(self)

    def stops(tour):
        return [(int(graph.cluster[v]), odd[v]) for v in tour]

    def told(bound, cells, visited):
        assert not len(visited) or set(cells.cluster[visited]) == set(range(graph.goal_count + 1))
        return stops(best), told_length

    monkeypatch.setattr(covers, "_Level", Noted)
    found = covers.refine_covers(tower, stops(other), given, Limits(), told)
    assert levels[0].run.length == given
    assert len(levels) > 1
    for level in levels[1:]:
        tour, length = (best, told_length) if much else (other, given)
        assert level.run.length == length
        own = level.cells.cells_of(graph.cluster, odd)[tour]
        assert level.cell_tour.tolist() == own.tolist()
    assert found.bound <= length * (1.0 + 1e-9)


def test_a_cover_that_has_proven_nothing_tells_nothing(monkeypatch):
    graph, odd, tower, _ = towers(1)
    best = solve_graph(graph, "auto")
    stops = [(int(graph.cluster[v]), odd[v]) for v in best.tour]
    price, heard, clock = Root._price, [], Clock()

    def priced(self, *args, **more):
        if len(self.costs) > graph.goal_count + 1:
            raise RunStopped
        return price(self, *args, **more)

    monkeypatch.setattr(Root, "_price", priced)
    covers.refine_covers(tower, stops, 1.5 * best.length, Limits(clock), lambda *a: heard.append(a))
    assert len(heard) == 1
