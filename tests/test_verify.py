"""The judge passes what is right and fails every single thing that can be wrong."""

import math

import numpy as np
import pytest
from hypothesis import given, settings

from netsp import Circle, InfeasibleError, Problem, solve, travel_graph, verify
from netsp.hsignature import signature
from netsp.judge.stringpull import StringPuller, reduce_sleeve
from netsp.roadmap.taut import TautRoadmap
from netsp.solution import ProblemReference, Status
from tests.worlds import random_world, small_worlds


@pytest.fixture(scope="module")
def pair():
    """Two goals behind a circle, one of them deep: the plain tour would entangle."""
    problem = Problem(
        base=(0, 0),
        goals=[(5.5, 2), (5.5, -2, -1), (9, 0.5)],
        obstacles=[Circle(center=(5, 0), radius=1), Circle(center=(0, 6), radius=1, name="far")],
        tether_length=12,
        bounds=(-3, -9, 12, 9),
    )
    return problem, solve(problem)


def failed(problem, solution):
    return {c.name for c in verify(problem, solution).checks if not c.passed}


def edit(solution, **changes):
    return solution.model_copy(update=changes)


def visits(solution, k, **changes):
    tour = list(solution.tour)
    tour[k] = tour[k].model_copy(update=changes)
    return edit(solution, tour=tuple(tour))


def test_a_right_solution_passes(pair):
    verdict = verify(*pair)
    assert verdict, str(verdict)
    assert len(verdict.checks) == 13


def test_another_problem_fails(pair):
    problem, solution = pair
    other = ProblemReference(name="x", sha256="0" * 64)
    assert failed(problem, edit(solution, problem=other)) == {"belongs to the problem"}


def test_a_path_that_does_not_close_fails(pair):
    problem, solution = pair
    assert "starts and ends at the base" in failed(problem, edit(solution, path=solution.path[:-1]))


def test_a_goal_left_out_fails(pair):
    problem, solution = pair
    assert "names every goal once" in failed(problem, edit(solution, tour=solution.tour[1:]))


def test_a_goal_named_twice_fails(pair):
    problem, solution = pair
    tour = (*solution.tour, solution.tour[0])
    assert "names every goal once" in failed(problem, edit(solution, tour=tour))


def test_a_goal_passed_by_at_a_distance_fails(pair):
    problem, solution = pair
    goal = problem.goals[1].position
    path = tuple((x, y, z + 0.01) if (x, y, z) == goal else (x, y, z) for x, y, z in solution.path)
    assert "visits every goal in order" in failed(problem, edit(solution, path=path))


def test_the_wrong_order_fails(pair):
    problem, solution = pair
    assert failed(problem, edit(solution, tour=solution.tour[::-1])) != set()


def test_a_path_through_an_obstacle_fails(pair):
    problem, solution = pair
    k = next(i for i, p in enumerate(solution.path) if p == problem.goals[0].position)
    path = (*solution.path[: k + 1], (5.0, 0.1, 0.0), *solution.path[k:])
    assert "enters no obstacle" in failed(problem, edit(solution, path=path))


def test_a_path_out_of_bounds_fails(pair):
    problem, solution = pair
    path = ((0.0, 0.0, 0.0), (-4.0, 0.0, 0.0), *solution.path)
    assert "stays within bounds" in failed(problem, edit(solution, path=path))


def test_a_wrong_word_fails(pair):
    problem, solution = pair
    assert "tether word at every goal" in failed(problem, visits(solution, 0, signature=(2,)))


def test_a_loop_round_an_obstacle_fails_twice_over(pair):
    """Both opinions see it: the rays and the triangles."""
    problem, solution = pair
    loop = tuple(
        (5 + 1.2 * math.cos(a), 1.2 * math.sin(a), 0.0) for a in np.linspace(math.pi, -math.pi, 60)
    )
    path = (solution.path[0], *loop, *solution.path)
    bad = failed(problem, edit(solution, path=path))
    assert {"total word is empty", "contractible over triangles", "length is right"} <= bad


def test_a_tether_too_long_fails(pair):
    problem, solution = pair
    longest = max(v.tether_length for v in solution.tour)
    shorter = problem.model_copy(update={"tether_length": longest * 0.999})
    bad = failed(shorter, edit(solution, problem=ProblemReference(name="x", sha256=shorter.sha256)))
    assert "taut tether fits" in bad


def test_a_wrong_tether_length_fails(pair):
    problem, solution = pair
    wrong = visits(solution, 1, tether_length=solution.tour[1].tether_length + 0.01)
    assert failed(problem, wrong) == {"taut lengths as stated"}


@pytest.mark.parametrize("factor", [0.999, 1.001])
def test_a_wrong_length_fails(pair, factor):
    problem, solution = pair
    length = solution.length * factor
    wrong = edit(solution, length=length, lower_bound=length, gap=0.0)
    assert "length is right" in failed(problem, wrong)


@pytest.mark.parametrize(
    "changes",
    [
        {"lower_bound": 1e9},
        {"gap": 0.5},
        {"gap": None},
        {"lower_bound": 1.0, "gap": 0.95},
        {"status": Status.INFEASIBLE},
    ],
)
def test_a_proof_that_does_not_add_up_fails(pair, changes):
    problem, solution = pair
    assert "bound, gap and status agree" in failed(problem, edit(solution, **changes))


def test_no_tour_fails(pair):
    problem, solution = pair
    none = edit(solution, length=None, lower_bound=None, gap=None, tour=(), path=(),
                status=Status.NO_SOLUTION_FOUND)  # fmt: skip
    assert failed(problem, none) == {"has a tour"}


@pytest.mark.parametrize("seed", range(4))
def test_pulled_lengths_bracket_the_exact_ones_for_every_class(seed):
    """Two methods that share no code agree on every tether of a random world."""
    problem = random_world(seed, goals=5, tether=320.0)
    roadmap = TautRoadmap(problem)
    puller = StringPuller(problem, reach=320.0)
    for v in range(1, len(roadmap.cluster)):
        path = roadmap.to_travel_graph().path(0, v)
        sleeve = reduce_sleeve([c for piece in puller.crossings(path) for c in piece])
        pulled = puller.pull(path[0], path[-1], sleeve)
        assert pulled.low <= roadmap.planar[v] * (1 + 1e-9)
        assert roadmap.planar[v] <= pulled.high * (1 + 1e-6)
        assert pulled.high - pulled.low <= 2e-4 * problem.tether_length


@settings(max_examples=40, deadline=None)
@given(small_worlds(grid=True))
def test_the_two_opinions_on_homotopy_agree(problem):
    """Every pair of classes of one goal differs by a loop that neither method can shrink."""
    try:
        roadmap = TautRoadmap(problem)
    except InfeasibleError:
        return
    graph = roadmap.to_travel_graph()
    puller = StringPuller(problem, reach=problem.tether_length)
    members = graph.members(1)[:5]
    for u in members:
        for v in members:
            loop = np.vstack([graph.path(0, int(u)), graph.path(0, int(v))[::-1][1:]])
            word = signature(loop, problem.representative_points)
            sleeve = reduce_sleeve([c for piece in puller.crossings(loop) for c in piece])
            assert (word == ()) == (sleeve == []) == (u == v)


@settings(max_examples=25, deadline=None)
@given(small_worlds(goals=2))
def test_every_solution_of_a_small_world_is_verified(problem):
    try:
        graph = travel_graph(problem)
    except InfeasibleError:
        return
    if len(graph) > 150:
        return
    verdict = verify(problem, solve(problem))
    assert verdict, f"{problem.to_json()}\n{verdict}"
