"""The shortest tour of the legs of many tours."""

import random
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import travel_graph
from netsp.clock import Clock
from netsp.mip.merging import merged
from netsp.mip.solve import solve_merged
from netsp.solving.limits import Limits
from netsp.solving.searching import SearchingRun
from netsp.travel.graph import TravelGraph
from netsp.worlds import random_world
from tests.brute import brute_tour
from tests.test_contract import random_graph


def some_tours(graph, chance, count):
    """Each of one class of every goal, in any order."""
    members = [np.flatnonzero(graph.cluster == c).tolist() for c in range(graph.goal_count + 1)]
    return [
        [0, *(chance.choice(m) for m in chance.sample(members[1:], len(members) - 1))]
        for _ in range(count)
    ]


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 6), st.randoms(use_true_random=False))
def test_it_is_the_shortest_of_their_legs_and_no_longer_than_any(seed, count, chance):
    graph = random_graph(seed, 5, most=3)
    tours = some_tours(graph, chance, count)
    found = merged(graph, tours, solve_merged, Limits())
    legs = {frozenset(leg) for t in tours for leg in zip(t, np.roll(t, -1).tolist(), strict=True)}
    assert {frozenset(leg) for leg in zip(found, np.roll(found, -1).tolist(), strict=True)} <= legs
    only = np.full(graph.costs.shape, np.inf)
    for u, v in map(tuple, legs):
        only[u, v] = only[v, u] = graph.costs[u, v]
    least = brute_tour(TravelGraph.from_costs(only, graph.cluster))
    assert graph.tour_length(found) == pytest.approx(least, rel=2e-6)


def test_searches_from_the_start_give_different_tours_and_the_merged_is_no_longer():
    graph = travel_graph(random_world(3, goals=40, tether_length=250.0))
    run = SearchingRun(graph, Limits(rng=np.random.default_rng(0)), search_rounds=5)
    tours = run.search_from_start(6, Clock())
    assert len(tours) == 6
    assert len({round(graph.tour_length(t), 6) for t in tours}) > 1
    assert run.length == pytest.approx(min(graph.tour_length(t) for t in tours))
    found = merged(graph, tours, solve_merged, Limits())
    assert graph.is_tour(found)
    assert graph.tour_length(found) < 0.995 * run.length
    assert merged(graph, [], solve_merged, Limits()) is None
    # the best one is among them from then on
    assert run.search_from_start(1, Clock())[0] == run.tour
    assert run.search_from_start(1, Clock(0.0)) == [run.tour]


def test_tours_of_very_many_classes_are_merged_by_a_program_that_merges_nothing(monkeypatch):
    graph = random_graph(0, 5, most=3)
    monkeypatch.setattr(sys.modules["netsp.mip.solve"], "MANY_CLASSES", 2)
    monkeypatch.setattr(sys.modules["netsp.mip.solve"], "MANY_GOALS", 2)
    tours = some_tours(graph, random.Random(0), 4)
    found = merged(graph, tours, solve_merged, Limits(Clock(60.0)))
    assert graph.is_tour(found)
