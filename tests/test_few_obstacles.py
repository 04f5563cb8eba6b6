"""Bounds from few of a problem's obstacles (`netsp.plan.space.few_obstacles`)."""

from __future__ import annotations

import numpy as np
import pytest

from netsp import Problem, solve
from netsp.base.clock import Clock
from netsp.plan.space.few_obstacles import blocking_obstacles, solve_with_few_obstacles


def random_problem(seed: int) -> Problem:
    """Five goals among five posts, none of which holds a goal."""
    rng = np.random.default_rng(seed)
    goals = rng.uniform(1.0, 9.0, (5, 2))
    posts = []
    while len(posts) < 5:
        centre = rng.uniform(1.0, 9.0, 2)
        if np.linalg.norm(goals - centre, axis=1).min() > 0.5:
            posts.append({"center": centre.tolist(), "radius": 0.3})
    return Problem(base=(0, 0), goals=goals.tolist(), obstacles=posts, tether_length=16.0)


@pytest.mark.parametrize("seed", range(8))
def test_bounds_rise_up_to_the_shortest_tour_and_never_exceed_it(seed):
    problem = random_problem(seed)
    shortest = solve(problem).length
    found = list(solve_with_few_obstacles(problem, Clock(20.0), max_added=1))
    bounds = [few.bound for few in found]
    assert all(few.is_solved for few in found)
    assert np.diff(bounds).min(initial=0.0) >= -1e-9 * shortest
    assert bounds[-1] <= shortest * (1.0 + 1e-9)
    assert [len(few.problem.obstacles) for few in found] == list(range(len(found)))


def test_a_tour_around_two_posts_is_bounded_by_the_detour_that_the_deeper_one_costs():
    """A square tour of 12 m encloses one post in its middle, and one 0.5 m inside a side."""
    corners = [(3, 0), (3, 3), (0, 3)]
    posts = [{"center": c, "radius": 0.2} for c in ((1.5, 1.5), (1.5, 0.5))]
    problem = Problem(base=(0, 0), goals=corners, obstacles=posts, tether_length=9.0)
    found = list(solve_with_few_obstacles(problem, Clock(20.0), max_added=1))
    assert found[0].bound == pytest.approx(12.0)
    assert found[0].blocking == (0, 1)
    assert found[1].bound > 12.0 + 1e-6
    assert found[-1].bound == pytest.approx(solve(problem).length)


def test_where_no_post_entangles_a_path_those_that_it_crosses_are_given():
    posts = [{"center": (x, y), "radius": 0.5} for x, y in ((2, 0.2), (5, 0.1), (5, 3))]
    problem = Problem(base=(0, 0), goals=[(8, 0)], obstacles=posts, tether_length=20.0)
    there_and_back = np.array([(0, 0), (8, 0), (0, 0)])
    assert blocking_obstacles(problem, set(), there_and_back) == (1, 0)
    assert blocking_obstacles(problem, {0, 1}, there_and_back) == ()
