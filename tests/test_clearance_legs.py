"""Legs that keep a clearance between classes of a tether that does not."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp.base.geometry import polylines
from netsp.model.problem import Circle, Problem
from netsp.plan.space.clearance_legs import ClearanceLegs
from netsp.roadmap.taut import TautRoadmap


def problem(clearance: float, obstacles, goals, tether: float = 14.0) -> Problem:
    return Problem(
        base=(0, 0), goals=goals, obstacles=obstacles, tether_length=tether, clearance=clearance
    )


def test_a_leg_around_a_post_is_as_long_as_that_around_the_post_grown_by_the_clearance():
    posts, goals, room = [Circle(center=(4, 0), radius=1.0)], [(8, 0)], 0.5
    graph = TautRoadmap(problem(0.0, posts, goals)).to_travel_graph()
    legs = ClearanceLegs(graph, problem(room, posts, goals))
    assert legs.raise_along([0, 1, 0])
    r = 1.0 + room
    expected = 2.0 * math.sqrt(16 - r**2) + r * (math.pi - 2.0 * math.acos(r / 4))
    assert legs.costs[0, 1] == pytest.approx(expected, rel=1e-9)
    assert not legs.raise_along([0, 1, 0])


@settings(max_examples=12, deadline=None)
@given(seed=st.integers(0, 10_000), room=st.floats(0.01, 0.3))
def test_legs_with_clearance_are_no_shorter_and_their_paths_keep_it(seed, room):
    rng = np.random.default_rng(seed)
    posts = [
        Circle(center=(2.0 + 3.0 * k, float(rng.uniform(-1, 1))), radius=float(rng.uniform(0.2, 1)))
        for k in range(2)
    ]
    goals = [(float(x), float(y)) for x, y in zip((3.5, 7.0), rng.uniform(2, 3, 2), strict=True)]
    graph = TautRoadmap(problem(0.0, posts, goals)).to_travel_graph()
    legs = ClearanceLegs(graph, problem(room, posts, goals), missing_cost=math.inf)
    before = legs.costs.copy()
    vertices = list(range(len(graph)))[:6]
    legs.raise_along(vertices)
    assert (legs.costs >= before).all()
    for u, v in pairwise(vertices):
        if not np.isfinite(legs.costs[u, v]):
            continue  # the leg's class is closed to the robot, or both are of one goal
        path = legs.path(u, v)
        assert polylines.length(path) >= legs.costs[u, v] * (1.0 - 1e-9)
        for post in posts:
            away = np.linalg.norm(polylines.dense(path, 0.01)[:, :2] - post.center, axis=1)
            assert away.min() >= post.radius + room - 1e-6
