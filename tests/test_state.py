"""A problem that starts in the middle of a tour: the rest of an optimal tour is optimal, and small
ones agree with brute force."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import Circle, InfeasibleError, InputError, Problem, solve, solve_graph, verify
from netsp.base.clock import Clock
from netsp.model.problem import State
from netsp.plan.random_worlds import random_world
from netsp.plan.solver_table import SOLVERS
from netsp.roadmap.from_state import graph_from_state

GEOMETRIC = {s.name for s in SOLVERS.values() if s.geometric}

FEW = {"goals": [(4, 0), (0, 4)], "base": (-3, 0), "obstacles": [Circle(center=(0, 0), radius=1)]}


def after(problem, solution, k):
    """What is left of a solution after its k-th visit, as a problem, with the goals in it."""
    here, rest = solution.tour[k - 1], [v.goal for v in solution.tour[k:]]
    state = State(position=problem.goals[here.goal].position, signature=here.signature)
    left = {"goals": tuple(problem.goals[g] for g in rest), "state": state}
    return problem.model_copy(update=left), rest


@pytest.mark.parametrize("seed", range(4))
def test_the_rest_of_an_optimal_tour_is_an_optimal_path(seed):
    problem = random_world(goals=8, tether_length=300, seed=seed)
    whole = solve(problem)
    for k in (1, 4, 7):
        left, _ = after(problem, whole, k)
        path = solve(left)
        assert path.status.value == "optimal"
        assert verify(left, path), verify(left, path)
        points = np.array(whole.path)
        at = np.linalg.norm(points - left.state.position, axis=1).argmin()
        drawn = np.linalg.norm(np.diff(points[at:], axis=0), axis=1).sum()
        assert path.length <= drawn * (1 + 1e-9)
        assert path.length == pytest.approx(drawn, rel=1e-3)
        assert path.lower_bound == pytest.approx(path.length, rel=2e-5)


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 200), st.integers(1, 3))
def test_small_open_problems_agree_with_brute_force(seed, k):
    problem = random_world(goals=4, tether_length=250, seed=seed)
    left, _ = after(problem, solve(problem), k)
    graph = graph_from_state(left)
    legs = graph.within
    classes = [graph.members(c) for c in range(1, len(left.goals) + 1)]
    best = min(
        legs.walk_length([graph.start, *walk, 0])
        for order in itertools.permutations(classes)
        for walk in itertools.product(*order)
    )
    assert solve(left).length == pytest.approx(best, rel=1e-9)


@pytest.mark.parametrize("solver", sorted(set(SOLVERS) - GEOMETRIC))
def test_every_solver_takes_a_state(solver):
    problem = random_world(goals=6, tether_length=250, seed=3)
    left, _ = after(problem, solve(problem), 2)
    path = solve(left, solver, iteration_limit=2000, time_limit=20)
    assert verify(left, path), verify(left, path)
    assert path.length >= solve(left).length * (1 - 1e-9)
    assert path.lower_bound is None or path.lower_bound <= solve(left).length * (1 + 1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_from_a_state_there_is_a_bound_whatever_the_time(seed):
    problem = random_world(goals=14, tether_length=300, seed=seed)
    left, _ = after(problem, solve(problem), 3)
    best = solve(left).length
    clock = Clock()
    clock.end()
    found = solve_graph(graph_from_state(left), "auto", time_limit=clock)
    assert 0.2 * best < found.lower_bound <= best <= found.length
    legs = graph_from_state(left)
    bounds, costs = legs.distances_between_goals(), legs.costs
    least = np.array([
        [costs[np.ix_(legs.members(a), legs.members(b))].min() for b in range(len(bounds))]
        for a in range(len(bounds))
    ])  # fmt: skip
    apart = ~np.eye(len(bounds), dtype=bool)
    assert (bounds[apart] <= least[apart] * (1.0 + 1e-9)).all()
    assert (bounds[apart] > 0.5 * least[apart]).mean() > 0.8


@pytest.mark.parametrize("solver", sorted(GEOMETRIC))
def test_solvers_blind_to_the_tether_refuse_a_state(solver):
    problem = random_world(goals=4, tether_length=250, seed=3)
    left, _ = after(problem, solve(problem), 2)
    with pytest.raises(InputError, match="needs the geometry"):
        solve(left, solver)


def test_a_wrapped_tether_is_taken_back():
    """Behind the post with the tether wrapped once about it, the way home is round it again."""
    once = State(position=(2.0, 0.0, 0.0), signature=(1, 1))
    problem = Problem(**FEW, tether_length=30, state=once)
    direct = problem.model_copy(update={"state": State(position=(2.0, 0.0, 0.0), signature=(1,))})
    assert solve(problem).length > solve(direct).length + 3
    assert verify(problem, solve(problem))


def test_a_tether_that_is_too_long_already_may_be_at_the_start_only():
    wound = State(position=(2.0, 0.0, 0.0), signature=(1, 1, 1))
    problem = Problem(**FEW, tether_length=8.5, state=wound)
    path = solve(problem)
    assert verify(problem, path)
    assert np.linalg.norm(np.diff(path.start_tether, axis=0), axis=1).sum() > 8.5
    assert max(v.tether_length for v in path.tour) <= 8.5


@pytest.mark.parametrize(
    ("state", "message"),
    [
        ({"position": [0.5, 0]}, "state.position.*lies inside"),
        ({"position": [2, 0], "signature": [2]}, "state.signature: expected letters from 1 to 1"),
        ({"position": "here"}, "state.position"),
    ],
)
def test_bad_states_are_named(state, message):
    with pytest.raises(InputError, match=message):
        Problem(**FEW, tether_length=9, state=state)


def test_goals_out_of_reach_are_named():
    with pytest.raises(InfeasibleError, match=r"goal #0 is out of reach"):
        solve(Problem(**FEW, tether_length=6, state=State(position=(-2, 0, 0))))


def test_a_solution_that_starts_elsewhere_fails():
    problem = random_world(goals=4, tether_length=250, seed=3)
    left, _ = after(problem, solve(problem), 2)
    path = solve(left)
    assert not verify(left, path.model_copy(update={"start_tether": ()}))
    shifted = tuple((x + 1.0, y, z) for x, y, z in path.start_tether)
    assert not verify(left, path.model_copy(update={"start_tether": shifted}))
    assert path == type(path).from_json(path.to_json())
