"""Tethers to any place are those that the roadmap has at a goal there."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import Circle, InfeasibleError, InputError, Polygon, Problem, Tethers, travel_graph
from netsp.base.geometry import polylines
from netsp.hsignature import signature
from tests.worlds import random_world


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**6), tether=st.floats(150.0, 330.0))
def test_all_classes_at_goals_and_the_shortest(seed, tether):
    """A world's obstacles alone: the goals are then asked for as places."""
    problem = random_world(seed, goals=4, tether=tether)
    tethers = Tethers(problem)
    try:
        graph = travel_graph(problem)
    except InfeasibleError:
        missing = [tethers.to(*g.position[:2], z=g.position[2]) for g in problem.goals]
        assert None in missing
        return
    for k, goal in enumerate(problem.goals, 1):
        x, y, z = goal.position
        found = tethers.classes(x, y, z)
        members = graph.members(k)
        wanted = {graph.signatures[v]: graph.tethers[v] for v in members}
        assert {t.word for t in found} == wanted.keys()
        for t in found:
            assert t.length == pytest.approx(wanted[t.word], rel=1e-7)
            assert polylines.length(t.path) == pytest.approx(t.length, rel=2e-3)
            assert signature(t.path[:, :2], problem.representative_points) == t.word
            assert np.allclose(t.path[[0, -1]], [problem.points[0], goal.position])
        assert [t.length for t in found] == sorted(t.length for t in found)
        assert tethers.to(x, y, z=z).length == pytest.approx(found[0].length)
        again = tethers.to(x, y, found[-1].word, z)
        assert again.length == pytest.approx(found[-1].length)


def test_places_in_solids_and_out_of_bounds_have_none():
    problem = Problem(
        base=(0, 0), goals=[(1, 1)], tether_length=20, clearance=0.5, bounds=(-5, -5, 30, 5),
        obstacles=[Circle(center=(5, 0), radius=1), Polygon(polygon=[(9, -1), (11, -1), (10, 3)])],
    )  # fmt: skip
    tethers = Tethers(problem)
    assert tethers.to(5, 1.4) is None
    assert tethers.to(5, 1.6) is not None
    assert tethers.to(10, 0) is None
    assert tethers.to(0, 6) is None
    assert tethers.to(25, 0) is None
    assert tethers.to(15, 0, (9,)) is None
    assert tethers.classes(10, 0) == []
    with pytest.raises(InputError, match="x: expected a finite number"):
        tethers.to(math.nan, 0)


def test_a_word_need_not_be_reduced_and_zero_distance_is_no_problem():
    problem = Problem(base=(0, 0), goals=[(9, 0)], tether_length=20,
                      obstacles=[Circle(center=(5, 0), radius=1)])  # fmt: skip
    tethers = Tethers(problem)
    one = tethers.to(9, 1, (1, -1, 1))
    assert one.word == (1,)
    here = tethers.to(0, 0)
    assert here.length == pytest.approx(0.0, abs=1e-6)
    assert here.word == ()
