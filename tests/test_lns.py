"""`lns`: searches that share what time or rounds there are."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp.base.clock import Clock
from netsp.base.compiled.rng import seeded
from netsp.gtsp.limits import Limits
from netsp.gtsp.search.descent import descend, two_opt
from netsp.gtsp.search.layers import LayeredInstance, best_classes
from netsp.gtsp.search.links import Tables, best_place, link, no_links, put, take_out, write_order
from netsp.gtsp.search.lns_solver import Params, solve
from netsp.gtsp.search.local_search import Search
from netsp.gtsp.search.ruin import StringPolicy, ruin_and_recreate
from tests.travel_graphs import random_graph


@pytest.mark.parametrize("how", [{"time": 0.5}, {"iterations": 400}])
def test_every_restart_has_its_share_of_time_or_rounds(how):
    graph, rows = random_graph(0, 12), []
    solve(graph, limits=Limits(iterations=10))  # compiled code is read before time counts
    solve(
        graph,
        Params(restarts=4),
        Limits(**how, rng=np.random.default_rng(0), on_progress=rows.append),
    )
    stages = [r.stage for r in rows]
    began = [k for k, stage in enumerate(stages) if stage == "settled"]
    assert len(began) == 4
    # and each went on to search
    assert all(stages[k + 1] == "search" for k in began)


STRINGS = StringPolicy(max_string_length=10, mean_removed=10, blink_rate=0.01)

PLACES = st.sampled_from([1, 5, 1000])
"""Few places for many vertices: ties."""


@given(st.integers(0, 10_000), st.integers(1, 14), PLACES)
@settings(max_examples=60, deadline=None)
def test_whatever_is_taken_out_and_put_back_the_tables_are_those_of_the_tour(seed, goals, places):
    rng, i, order = _begun(seed, goals, places)
    links, row = no_links(goals + 1, i.largest), np.empty(i.largest)
    length = link(order, links, i.start, i.costs, row)
    assert length == pytest.approx(best_classes(order[1:], i.start, i.costs)[0], abs=1e-9)
    after, prior, ahead, behind, step_ahead, step_behind = links
    state = (after, prior, i.start, i.costs, ahead, behind, step_ahead, step_behind, row)
    for c in rng.permutation(np.arange(1, goals + 1)).tolist():
        length += take_out(c, *state)
        _same_tables(i, links)
        p, longer = best_place(
            c, after, prior, i.start, i.costs, i.cluster_costs, i.near, *i.neighbours, i.before,
            ahead, behind, step_behind, np.empty(goals + 1, dtype=np.int64), 0.0, seeded(rng),
        )  # fmt: skip
        assert put(c, p, *state) == pytest.approx(longer, abs=1e-9)
        length += longer
        write_order(after, order)
        assert sorted(order.tolist()) == list(range(goals + 1))
        _same_tables(i, links)
        assert length == pytest.approx(best_classes(order[1:], i.start, i.costs)[0], abs=1e-9)


@given(st.integers(0, 10_000), st.integers(2, 9), PLACES, st.booleans())
@settings(max_examples=100, deadline=None)
def test_a_cluster_is_put_where_it_lengthens_the_tour_least(seed, goals, places, ordered):
    rng, i, order = _begun(seed, goals, places)
    if ordered:
        i.before = _some_precedences(rng, order)
    c = int(rng.choice(order[1:]))
    left = order[order != c]
    links = no_links(goals + 1, i.largest)
    length = link(left, links, i.start, i.costs, np.empty(i.largest))
    after, prior, ahead, behind, _, step_behind = links
    p, longer = best_place(
        c, after, prior, i.start, i.costs, i.cluster_costs, i.near, *i.neighbours, i.before, ahead,
        behind, step_behind, np.empty(goals + 1, dtype=np.int64), 0.0, seeded(rng),
    )  # fmt: skip
    each = [np.insert(left, k, c) for k in range(1, len(left) + 1)]
    kept = [o for o in each if _keeps(o, i.before)]
    best = min(best_classes(o[1:], i.start, i.costs)[0] for o in kept)
    assert length + longer == pytest.approx(best, abs=1e-9)
    assert _keeps(np.insert(left, int(np.flatnonzero(left == p)[0]) + 1, c), i.before)


@given(st.integers(0, 10_000), st.integers(4, 14), PLACES)
@settings(max_examples=40, deadline=None)
def test_no_move_breaks_a_precedence(seed, goals, places):
    rng, i, order = _begun(seed, goals, places)
    i.before = _some_precedences(rng, order)
    links, tables, stop = no_links(goals + 1, i.largest), _tables(i), np.zeros(1, dtype=np.int64)
    length = link(order, links, i.start, i.costs, np.empty(i.largest))
    best, chance = order.copy(), seeded(rng)
    ruin_and_recreate(order, best, length, length, 100, 100.0, tables, links, STRINGS, chance)
    assert _keeps(order, i.before)
    assert _keeps(best, i.before)
    descend(order, tables, links, chance, stop)
    assert _keeps(order, i.before)
    two_opt(order, tables, stop)
    assert _keeps(order, i.before)


@given(st.integers(0, 10_000), st.integers(4, 14), PLACES)
@settings(max_examples=40, deadline=None)
def test_descent_ends_where_its_links_and_lengths_say_and_no_longer(seed, goals, places):
    rng, i, order = _begun(seed, goals, places)
    links, tables = no_links(goals + 1, i.largest), _tables(i)
    begun = link(order, links, i.start, i.costs, np.empty(i.largest))
    moved = descend(order, tables, links, seeded(rng), np.zeros(1, dtype=np.int64))
    assert moved <= begun + 1e-9
    assert moved == pytest.approx(best_classes(order[1:], i.start, i.costs)[0], abs=1e-9)
    _same_tables(i, links)
    turned = two_opt(order, tables, np.zeros(1, dtype=np.int64))
    assert turned <= moved + 1e-9
    assert turned == pytest.approx(best_classes(order[1:], i.start, i.costs)[0], abs=1e-9)


@given(st.integers(0, 10_000), st.integers(3, 14), PLACES)
@settings(max_examples=60, deadline=None)
def test_after_rounds_the_tables_are_those_of_the_order_however_they_were_counted_out(
    seed, goals, places
):
    rng = np.random.default_rng(seed)
    i = _random_instance(rng, goals, places)
    found = []
    for counts in ([200], [1, 1, 48, 150]):
        order, chance = np.arange(goals + 1), seeded(np.random.default_rng(seed))
        best, links = order.copy(), no_links(goals + 1, i.largest)
        length = shortest = link(order, links, i.start, i.costs, np.empty(i.largest))
        for count in counts:
            length, shortest = ruin_and_recreate(
                order, best, length, shortest, count, 100.0, _tables(i), links, STRINGS, chance
            )
        _same_tables(i, links)
        assert length == pytest.approx(best_classes(order[1:], i.start, i.costs)[0], abs=1e-9)
        assert shortest == pytest.approx(best_classes(best[1:], i.start, i.costs)[0], abs=1e-9)
        found.append((order.tolist(), length, shortest))
    assert found[0] == found[1]


def _begun(seed, goals, places):
    """A generator, an instance and an order."""
    rng = np.random.default_rng(seed)
    i = _random_instance(rng, goals, places)
    return rng, i, np.concatenate([[0], 1 + rng.permutation(goals)])


def _random_instance(rng, goals, places):
    cluster = np.concatenate([[0], np.repeat(np.arange(1, goals + 1), rng.integers(1, 5, goals))])
    where = rng.integers(0, places + 1, (len(cluster), 2)).astype(float)
    return LayeredInstance(cluster, np.hypot(*(where[:, None] - where[None]).T))


def _some_precedences(rng, order):
    """Of what an order keeps some, closed transitively."""
    n = len(order)
    place = np.argsort(order)
    before = (rng.random((n, n)) < 0.15) & (place[:, None] < place[None])
    before[0] = before[:, 0] = False
    for k in range(n):
        before |= before[:, k, None] & before[k]
    return before


def _keeps(order, before):
    """Whether no goal comes after one that it must come before."""
    place = np.argsort(order)
    return not len(before) or not (before & (place[:, None] > place[None])).any()


def _tables(i):
    return Tables(
        i.start, i.costs, i.cluster_costs, i.near, *i.neighbours, i.rank, i.before, i.min_gain,
        i.rounding,
    )  # fmt: skip


def _same_tables(i, links):
    """Links and tables are those of the tour filled afresh."""
    tour = [0]
    while links.after[tour[-1]] != 0:
        tour.append(int(links.after[tour[-1]]))
    fresh = no_links(*links.ahead.shape)
    link(np.array(tour), fresh, i.start, i.costs, np.empty(i.largest))
    for c in tour:
        own = int(np.diff(i.start)[c])
        assert links.prior[c] == fresh.prior[c]
        for name in ("ahead", "behind"):
            is_, should = getattr(links, name)[c, :own], getattr(fresh, name)[c, :own]
            np.testing.assert_allclose(is_, should, rtol=1e-10, atol=1e-9)
        assert links.step_ahead[c] == pytest.approx(fresh.step_ahead[c], abs=1e-9)
        assert links.step_behind[c] == pytest.approx(fresh.step_behind[c], abs=1e-9)


COSTS = {
    "magnitudes from 1e-8 to 1e8": lambda rng, shape: 10.0 ** rng.uniform(-8.0, 8.0, shape),
    "fractions and forbidden legs of 1e15": lambda rng, shape: np.where(
        rng.random(shape) < 0.4, 1e15, rng.random(shape)
    ),
    "whole numbers and legs of 1e9": lambda rng, shape: np.where(
        rng.random(shape) < 0.4, 1e9, rng.integers(1, 10_000, shape)
    ),
    "huge whole numbers": lambda rng, shape: rng.integers(0, 10**12, shape).astype(float),
    "ties": lambda rng, shape: rng.integers(0, 3, shape).astype(float),
    "zeros and noise": lambda rng, shape: np.where(
        rng.random(shape) < 0.5, 0.0, 1e-12 * rng.random(shape)
    ),
    "a large number and noise": lambda rng, shape: 1e12 + rng.random(shape),
    "a large number and units": lambda rng, shape: 1e11 + rng.integers(0, 10, shape),
    "missing legs": lambda rng, shape: np.where(
        rng.random(shape) < 0.3, np.inf, 10.0 ** rng.uniform(-3.0, 12.0, shape)
    ),
}


@pytest.mark.parametrize("kind", COSTS)
def test_a_descent_ends_whatever_the_costs_and_its_length_is_that_of_its_order(kind):
    """A gain that was the rounding of larger numbers was taken again and again."""
    _settled(np.random.default_rng(0), "ties")  # compiled code is read before time counts
    clock = Clock(5.0)
    for seed in range(25):
        i, search = _settled(np.random.default_rng(seed), kind, clock)
        assert not clock.is_up
        length, _ = best_classes(search.order[1:], i.start, i.costs)
        assert search.length == pytest.approx(length, rel=1e-12)
        assert sorted(search.order.tolist()) == list(range(i.clusters))


WHOLE = ("whole numbers and legs of 1e9", "a large number and units", "ties")


@pytest.mark.parametrize("kind", WHOLE)
def test_a_move_that_saves_one_unit_counts_among_whole_numbers(kind):
    for seed in range(10):
        i, search = _settled(np.random.default_rng(seed), kind)
        for c in range(1, i.clusters):
            left = search.order[search.order != c]
            for k in range(1, i.clusters):
                moved = np.insert(left, k, c)
                assert best_classes(moved[1:], i.start, i.costs)[0] >= search.length


def _settled(rng, kind, clock=None):
    """An instance of random costs, and a search in it from a random order to where it settles."""
    goals = int(rng.integers(3, 12))
    cluster = np.concatenate([[0], np.repeat(np.arange(1, goals + 1), rng.integers(1, 4))])
    costs = np.triu(COSTS[kind](rng, (len(cluster), len(cluster))), 1)
    i = LayeredInstance(cluster, costs + costs.T)
    order = np.concatenate([[0], 1 + rng.permutation(goals)])
    search = Search(i, rng, order, clock)
    search.settle()
    return i, search
