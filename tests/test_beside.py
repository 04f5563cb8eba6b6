"""Classes beside a tour: those that lengthen it least, whatever their tether."""

from itertools import pairwise

import numpy as np
import pytest

from netsp import solve, travel_graph
from netsp.gtsp.gtsp_policy import GtspPolicy, ProofSearchPolicy
from netsp.gtsp.instance import cheapest_per_cluster
from netsp.gtsp.limits import Limits
from netsp.gtsp.neighbourhood import cheapest_insertions
from netsp.mip.mip_policy import MipPolicy
from netsp.mip.mip_solver import MipRun
from netsp.plan.random_worlds import random_world
from tests.travel_graphs import random_graph


def lengthens(graph, tour, v):
    """What vertex v adds to a tour, put in anywhere or in place of its goal's own vertex."""
    at = [graph.cluster[u] for u in tour].index(graph.cluster[v])
    ring = [*tour, tour[0]]
    put_in = [graph.costs[a, v] + graph.costs[v, b] - graph.costs[a, b] for a, b in pairwise(ring)]
    a, b = ring[at - 1], ring[at + 1]
    own = graph.costs[a, tour[at]] + graph.costs[tour[at], b]
    return min(*put_in, graph.costs[a, v] + graph.costs[v, b] - own)


@pytest.mark.parametrize("seed", range(6))
def test_of_each_goal_those_are_chosen_that_lengthen_the_tour_least(seed):
    graph = random_graph(seed, goals=6)
    rng = np.random.default_rng(seed)
    order = rng.permutation(np.arange(1, graph.goal_count + 1))
    tour = [0, *(int(rng.choice(graph.members(c))) for c in order)]
    chosen = cheapest_insertions(graph.lower_bounds(rows=tour), tour, graph.cluster, 2)
    assert 0 in chosen
    for goal in order:
        members = graph.members(goal)
        costs = sorted(lengthens(graph, tour, v) for v in members)
        found = sorted(lengthens(graph, tour, v) for v in members if v in chosen)
        assert found == pytest.approx(costs[:2])
    every = cheapest_insertions(graph.lower_bounds(rows=tour), tour, graph.cluster, len(graph))
    assert every.tolist() == list(range(len(graph)))


@pytest.mark.parametrize("seed", [0, 3, 4, 5])
def test_a_search_of_two_classes_a_goal_finds_more_than_those_of_least_tether_hold(seed):
    problem = random_world(seed, goals=20, tether_length=350.0)
    graph = travel_graph(problem)
    least = cheapest_per_cluster(graph.costs_to_base, graph.cluster, 2)
    shortest_of_these = solve_all(graph.subgraph(least))
    found = solve(problem, solver="lns", params={"classes": 2}, iteration_limit=3000)
    assert found.length < 0.95 * shortest_of_these


def solve_all(graph):
    run = MipRun(graph, Limits(time=60.0))
    result = run.solve("highs", None)
    assert result.status == "optimal"
    return result.length


def test_a_proof_begins_with_a_tour_beside_which_there_is_none_better():
    # three classes of each goal
    policy = MipPolicy(gtsp=GtspPolicy(proof_search=ProofSearchPolicy(core_vertices=40)))
    graph = travel_graph(random_world(0, goals=20, tether_length=350.0))
    run = MipRun(graph, Limits(iterations=10_000), search_rounds=300, policy=policy)
    run.find_first_tour()
    first = solve_all(
        graph.subgraph(
            cheapest_per_cluster(graph.costs_to_base, graph.cluster, run.core_classes_per_goal)
        )
    )
    core = run.search_near_incumbent()
    assert run.length < first - 1.0
    assert np.isin(run.tour, core).all()
