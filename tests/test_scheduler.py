"""The scheduler: which task runs next, and `auto` with tasks instead of routes by size."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import Status, TravelGraph, solve_graph, travel_graph
from netsp.gtsp.cost_oracle import Estimate
from netsp.gtsp.resumable import run_to_end
from netsp.gtsp.scheduler import Scheduler, SchedulerPolicy, Task
from netsp.gtsp.solver_run import RunStopped, SolverRun
from netsp.plan.random_worlds import random_world
from tests.travel_graphs import random_graph

SCHEDULER = {"scheduler": True}


class Gap:
    """A gap that tasks of a test narrow."""

    def __init__(self, length):
        self.length = length

    def __call__(self):
        return self.length


def closing(gap, lengths, noted):
    """Return a maker of steps that narrow a gap by given lengths and note each step."""

    def steps():
        for length in lengths:
            gap.length = max(gap.length - length, 0.0)
            noted.append(length)
            yield

    return steps


def scheduled(gap, tasks, **policy):
    """Return a scheduler under a limit of iterations, so that each step counts the same."""
    run = SolverRun(random_graph(0, 3))
    run.iteration_limit = 10**9
    return Scheduler(run, tasks, gap, SchedulerPolicy(step_s=1.0, probe_s=1.0, **policy))


def test_the_task_that_closes_more_per_second_gets_most_of_the_time():
    gap, slow, fast = Gap(1000.0), [], []
    tasks = [
        Task("slow", closing(gap, itertools.repeat(0.1), slow), Estimate(1.0, 0.0)),
        Task("fast", closing(gap, itertools.repeat(5.0), fast), Estimate(1.0, 0.0)),
    ]
    run_to_end(scheduled(gap, tasks).steps())
    assert gap() == 0.0
    assert slow  # each task is probed
    assert len(fast) > 5 * len(slow)


def test_a_task_is_not_forgotten_after_its_success_ends():
    gap, early, late = Gap(100.0), [], []
    tasks = [
        Task("early", closing(gap, [50.0, *[0.0] * 500], early), Estimate(1.0, 0.0)),
        Task("late", closing(gap, [0.0] * 20 + [100.0], late), Estimate(2.0, 0.0)),
    ]
    run_to_end(scheduled(gap, tasks).steps())
    assert gap() == 0.0
    assert len(early) < 500


def test_a_task_that_does_not_fit_into_the_memory_is_not_begun():
    gap, noted = Gap(10.0), []
    tasks = [
        Task("huge", closing(gap, [10.0], noted), Estimate(0.1, 1e18)),
        Task("small", closing(gap, [1.0], noted), Estimate(9.0, 0.0)),
    ]
    run_to_end(scheduled(gap, tasks).steps())
    assert noted == [1.0]


def test_a_task_that_stops_by_itself_leaves_the_time_to_the_others():
    gap, noted = Gap(10.0), []

    def stops():
        yield
        raise RunStopped

    tasks = [
        Task("stops", stops, Estimate(0.1, 0.0)),
        Task("closes", closing(gap, [5.0, 5.0], noted), Estimate(9.0, 0.0)),
    ]
    run_to_end(scheduled(gap, tasks).steps())
    assert noted == [5.0, 5.0]


def test_tasks_that_are_left_are_closed():
    gap, closed = Gap(1.0), []

    def holds():
        try:
            yield
            yield
        finally:
            closed.append(True)

    tasks = [
        Task("holds", holds, Estimate(0.1, 0.0)),
        Task("closes", closing(gap, [1.0], []), Estimate(0.5, 0.0)),
    ]
    run_to_end(scheduled(gap, tasks).steps())
    assert closed == [True]


def shortest(graph):
    """Return the length of the shortest tour, by trying all."""
    costs, goals = graph.costs, range(1, graph.goal_count + 1)
    best = np.inf
    for order in itertools.permutations(goals):
        if order[0] > order[-1]:
            continue
        for tour in itertools.product(*(graph.members(g).tolist() for g in order)):
            around = [0, *tour]
            best = min(best, costs[around, np.roll(around, -1)].sum())
    return best


@settings(max_examples=15)
@given(st.integers(0, 10**6), st.integers(2, 5), st.booleans())
def test_the_tour_is_the_shortest_of_all(seed, goals, sets):
    graph = random_graph(seed, goals, most=3)
    options = SCHEDULER if sets else SCHEDULER | {"policy.subsets.max_sums": 0.0}
    found = solve_graph(graph, params=options)
    assert found.status is Status.OPTIMAL
    assert found.length == pytest.approx(shortest(graph), rel=1e-6)


@pytest.mark.parametrize(("goals", "tether"), [(12, 300.0), (30, 250.0)])
def test_scheduler_and_routes_prove_the_same_length(goals, tether):
    graph = travel_graph(random_world(3, goals=goals, tether_length=tether))
    by_size, by_tasks = solve_graph(graph), solve_graph(graph, params=SCHEDULER)
    assert by_size.status is by_tasks.status is Status.OPTIMAL
    assert by_tasks.length == pytest.approx(by_size.length, rel=2e-6)


@settings(max_examples=10)
@given(st.integers(0, 10**6), st.integers(3, 5), st.booleans())
def test_with_precedences_the_tour_is_the_shortest_of_those_allowed(seed, goals, sets):
    graph = random_graph(seed, goals, most=3)
    first, then = 1 + np.random.default_rng(seed).permutation(goals)[:2]
    graph.before = np.zeros((goals + 1, goals + 1), dtype=bool)
    graph.before[first, then] = True
    options = SCHEDULER if sets else SCHEDULER | {"policy.subsets.max_sums": 0.0}
    found = solve_graph(graph, params=options)
    assert graph.is_tour(found.tour)
    assert found.status is Status.OPTIMAL
    assert found.length == pytest.approx(solve_graph(graph, "dp").length, rel=1e-6)
    assert found.length >= shortest(graph) * (1.0 - 1e-9)


@pytest.mark.parametrize("limit", [3, 30])
def test_the_same_seed_gives_the_same_result_under_a_limit_of_iterations(limit):
    problem = random_world(0, goals=14, tether_length=350.0)
    runs = [
        solve_graph(travel_graph(problem), params=SCHEDULER, iteration_limit=limit, seed=4)
        for _ in range(2)
    ]
    first, second = ((r.tour, r.length, r.lower_bound) for r in runs)
    assert first == second
    assert runs[0].tour is not None


def test_when_time_is_up_there_is_a_tour_and_a_bound():
    graph = travel_graph(random_world(0, goals=100, tether_length=350.0))
    found = solve_graph(graph, params=SCHEDULER, time_limit=1.0)
    assert graph.is_tour(found.tour)
    assert 0.0 < found.lower_bound <= found.length


def test_a_graph_without_any_tour_is_infeasible():
    costs = np.array([[0.0, 1.0, np.inf], [1.0, 0.0, np.inf], [np.inf, np.inf, 0.0]])
    costs[0, 2] = costs[2, 0] = 1.0
    graph = TravelGraph.from_costs(costs, [0, 1, 2])
    params = SCHEDULER | {"policy.subsets.max_sums": 0.0}
    found, by_size = solve_graph(graph, params=params), solve_graph(graph)
    assert found.status is by_size.status
