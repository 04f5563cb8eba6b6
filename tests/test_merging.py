"""The shortest tour through the classes of many tours."""

import itertools
import random
import sys
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import travel_graph
from netsp.base.clock import Clock
from netsp.gtsp.limits import Limits
from netsp.gtsp.searching import SearchingRun
from netsp.mip.merging import merge, merged_tour, visited_classes
from netsp.mip.mip_policy import CoverPolicy, MergingPolicy, MipPolicy
from netsp.mip.mip_solver import solve_merged
from netsp.plan.random_worlds import random_world
from tests.brute import brute_tour
from tests.travel_graphs import random_graph


def some_tours(graph, chance, count):
    """Each of one class of every goal, in any order."""
    members = [np.flatnonzero(graph.cluster == c).tolist() for c in range(graph.goal_count + 1)]
    return [
        [0, *(chance.choice(m) for m in chance.sample(members[1:], len(members) - 1))]
        for _ in range(count)
    ]


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 6), st.randoms(use_true_random=False))
def test_it_is_the_shortest_through_their_classes(seed, count, chance):
    graph = random_graph(seed, 5, most=3)
    tours = some_tours(graph, chance, count)
    found = merged_tour(graph, tours, solve_merged, Limits())
    classes = np.unique(np.concatenate(tours))
    assert set(found) <= set(classes.tolist())
    least = brute_tour(graph.subgraph(classes))
    assert graph.tour_length(found) == pytest.approx(least, rel=2e-6)


def test_searches_from_the_start_give_different_tours_and_the_merged_is_no_longer():
    graph = travel_graph(random_world(3, goals=40, tether_length=250.0))
    run = SearchingRun(graph, Limits(rng=np.random.default_rng(0)), search_rounds=5)
    tours = run.search_afresh(6, Clock())
    assert len(tours) == 6
    assert len({round(graph.tour_length(t), 6) for t in tours}) > 1
    assert run.length == pytest.approx(min(graph.tour_length(t) for t in tours))
    found = merged_tour(graph, tours, solve_merged, Limits())
    assert graph.is_tour(found)
    assert graph.tour_length(found) < 0.995 * run.length
    assert merged_tour(graph, [], solve_merged, Limits()) is None
    # the best one is among them from then on
    assert run.search_afresh(1, Clock())[0] == run.tour
    assert run.search_afresh(1, Clock(0.0)) == [run.tour]


def test_tours_of_very_many_classes_are_merged_by_a_program_that_merges_nothing():
    graph = random_graph(0, 5, most=3)
    policy = MipPolicy(many_goals=2, covers=CoverPolicy(min_classes=2))
    tours = some_tours(graph, random.Random(0), 4)
    prove = partial(solve_merged, policy=policy)
    found = merged_tour(graph, tours, prove, Limits(Clock(60.0)))
    assert graph.is_tour(found)


def ends_of(monkeypatch, least, limits):
    """Tours from which those of a run with so many goals are made, and the run."""
    module = sys.modules["netsp.mip.mip_solver"]
    given = []

    def merge(run, tours, prove, clock, known=module.merge):
        assert len(tours) == len(set(tours)) <= 9
        given.append(list(tours))
        known(run, tours, prove, clock)

    monkeypatch.setattr(module, "merge", merge)
    graph = travel_graph(random_world(3, goals=30, tether_length=250.0))
    policy = MipPolicy(merging=MergingPolicy(min_goals=least))
    run = module.MipRun(graph, limits, search_rounds=2, policy=policy)
    run.solve("highs", None)
    assert run.is_done
    return given


def test_what_searches_end_in_is_merged_once_where_goals_are_many(monkeypatch):
    given = ends_of(monkeypatch, 30, Limits(rng=np.random.default_rng(0)))
    assert given
    classes = [set(itertools.chain(*tours)) for tours in given]
    assert not any(b <= a for a, b in itertools.pairwise(classes))
    assert not ends_of(monkeypatch, 31, Limits(rng=np.random.default_rng(0)))


def test_a_merged_tour_that_a_bound_may_have_ruled_out_is_not_taken():
    graph = random_graph(0, 5, most=3)
    tours = some_tours(graph, random.Random(0), 6)
    best = brute_tour(graph.subgraph(visited_classes(tours)))
    for above, taken in ((0.5, True), (-1e-9, False)):
        run = SearchingRun(graph, Limits())
        run.known_length = best + above
        merge(run, tours, solve_merged, Clock())
        assert (run.tour is not None) == taken
    stopped = SearchingRun(graph, Limits())
    merge(stopped, tours, solve_merged, Clock(0.0))
    assert stopped.trace[-1].stage == "merged"


def test_under_a_limit_of_iterations_nothing_is_merged(monkeypatch):
    assert not ends_of(monkeypatch, 30, Limits(rng=np.random.default_rng(0), iterations=10_000))


def test_the_classes_of_a_hundred_goals_hold_a_shorter_tour_than_their_legs():
    graph = travel_graph(random_world(3, goals=100, tether_length=300.0))
    run = SearchingRun(graph, Limits(rng=np.random.default_rng(0)), search_rounds=500)
    tours = run.search_afresh(3, Clock())
    found = merged_tour(graph, tours, solve_merged, Limits())
    legs = {frozenset(leg) for t in tours for leg in zip(t, np.roll(t, -1).tolist(), strict=True)}
    new = {frozenset(leg) for leg in zip(found, np.roll(found, -1).tolist(), strict=True)} - legs
    assert new
    assert graph.tour_length(found) < 0.999 * run.length
