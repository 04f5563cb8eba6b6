"""Which obstacles covers tell apart next, and what they promise."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import solve_graph
from netsp.clock import Clock
from netsp.mip.covers import climb
from netsp.mip.overcells import Cells
from netsp.mip.splits import Splits, frustration
from netsp.solving.limits import Limits
from tests.test_even_crossings import towers


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
    assert frustration(*graph) >= least_frustration(*graph) - 1e-9


@settings(max_examples=100, deadline=None)
@given(signed_graphs(), st.randoms(use_true_random=False))
def test_what_goes_around_nothing_is_not_frustrated(graph, chance):
    ends, excess, sides = graph
    side = np.array([chance.choice(np.flatnonzero(s)) for s in sides])
    excess[np.arange(len(ends)), side[ends[:, 0]] ^ side[ends[:, 1]]] = 0.0
    assert frustration(ends, excess, sides) <= excess.sum() / 2.0 + 1e-9
    one_sided = np.arange(2) == side[:, None]
    assert frustration(ends, excess, one_sided) == 0.0
    # where legs tell which side their ends are on, a tree of them does
    excess[np.arange(len(ends)), 1 - (side[ends[:, 0]] ^ side[ends[:, 1]])] = 1.0
    assert frustration(ends, excess, np.ones_like(sides)) == 0.0


def test_once_around_costs_the_cheapest_leg_of_the_ring():
    ring = np.array([(0, 1), (1, 2), (2, 3), (0, 3)])
    excess = np.array([(0.0, 5.0), (0.0, 3.0), (0.0, 7.0), (6.0, 0.0)])
    both = np.ones((4, 2), dtype=bool)
    assert frustration(ring, excess, both) == 3.0
    # the ends of the leg that would give way have only one side
    both[1:3, 1] = False
    assert frustration(ring, excess, both) == 5.0


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
        found = tower.by_parity(cells, ends)
        np.testing.assert_array_equal(
            found.min(axis=2), np.repeat(tower.costs(cells)[*ends.T], tower.obstacles).reshape(
                len(ends), -1
            )
        )  # fmt: skip
        for i in range(1, tower.obstacles):
            split = tower.cells((0, i))
            costs, own = tower.costs(split), split.above(cells)
            least = np.full((m, m, 2), np.inf)
            side = split.code >> 1 & 1
            where = own[:, None], own[None, :], side[:, None] ^ side[None, :]
            np.minimum.at(least, where, costs)
            there = np.isfinite(least[*ends.T])
            assert (found[:, i][there] <= least[*ends.T][there]).all()
            if tower is both[0]:
                np.testing.assert_array_equal(found[:, i], least[*ends.T])


class TwoObstacles:
    """A ring of three goals around the second obstacle, that the first is no part of; both have
    two sides for each goal, and a third, that no leg crosses, has too."""

    obstacles = 3

    def cells(self, obstacles):
        goals = np.repeat(np.arange(1, 4), 1 << len(obstacles))
        codes = np.tile(np.arange(1 << len(obstacles)), 3)
        return Cells(obstacles, np.insert(goals, 0, 0), np.insert(codes, 0, 0))

    def by_parity(self, cells, ends):
        out = np.empty((len(ends), 3, 2))
        out[:] = 1.0, 4.0
        out[-1, 1] = 4.0, 1.0
        return out


def test_the_obstacle_that_a_point_goes_around_is_told_apart_first():
    tower = TwoObstacles()
    ring = np.array([(1, 2), (2, 3), (1, 3)])
    splits = Splits(tower, growth=1.3, most=100)
    assert splits.after(tower.cells(()), ring, np.ones(3), gap=10.0) == [1]
    # not as far as it would be worth more than the gap, nor with more cells than there may be
    assert Splits(tower, 1.3, most=6).after(tower.cells(()), ring, np.ones(3), gap=10.0) == []
    # what promised once is believed after a point that goes around nothing
    assert splits.after(tower.cells((0,)), ring[:2], np.ones(2), gap=10.0) == [1]


@pytest.mark.parametrize("seed", range(3))
def test_a_better_tour_that_is_told_is_gone_on_with(seed):
    graph, odd, tower, _ = towers(seed)
    best = solve_graph(graph, "auto")
    stops = [(int(graph.cluster[v]), odd[v]) for v in best.tour]
    heard = []

    def told(bound, cells, visited):
        heard.append((bound, len(cells.cluster)))
        assert not len(visited) or set(cells.cluster[visited]) == set(range(graph.goal_count + 1))
        return stops, best.length

    found = climb(tower, stops, 1.5 * best.length, Clock(), Limits(), told)
    assert found.bound <= best.length * (1.0 + 1e-9)
    if len(heard) > 1:
        own = found.cells.of(graph.cluster, odd)[list(best.tour)]
        assert not found.dead[own, np.roll(own, -1)].any()
