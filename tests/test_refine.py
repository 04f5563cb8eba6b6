"""Refined paths keep their ends and their freedom; ours never lose clearance."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import InputError
from netsp.base.geometry import polylines
from netsp.world import Scene
from netsp.world.paths.refine import REFINEMENTS, RefineParams, clear, perturbed, refined, smoothed
from netsp.world.paths.sampled import OMPL_PLANNERS, SampledPaths
from netsp.world.paths.tree import Grid, are_homotopic, pull_taut
from netsp.world.planner import PlannerOptions, make_planner

POST = Scene(solids=[{"post": {"center": [0, 0], "radius": 0.5}}], bounds=(-3, -3, -1, 3, 3, 1))
FIELD = POST.field()


def arc(radius, seed=0, wobble=0.0):
    a = np.linspace(0.0, np.pi, 25)
    path = radius * np.column_stack([np.cos(a), np.sin(a), 0 * a])
    path[1:-1] += wobble * np.random.default_rng(seed).normal(size=(23, 3))
    return path


@settings(max_examples=25, deadline=None)
@given(st.sampled_from(REFINEMENTS), st.floats(0.75, 2.0), st.integers(0, 100))
def test_ends_stay_and_free_ways_stay_free(name, radius, seed):
    path = arc(radius, seed, 0.03)
    better = refined(name, FIELD, path, 0.4, np.random.default_rng(seed))
    assert np.array_equal(better[[0, -1]], path[[0, -1]])
    assert clear(FIELD, better, 0.0)


@settings(max_examples=25, deadline=None)
@given(st.floats(0.7, 1.2), st.integers(0, 100))
def test_the_gradient_never_makes_clearance_worse(radius, seed):
    path = arc(radius, seed, 0.05)
    better = refined("gradient", FIELD, path, 0.4, np.random.default_rng(0))
    assert (FIELD.distance(better) >= FIELD.distance(path) - 1e-12).all()


def test_the_papers_steps_widen_an_arc_about_a_post_and_are_the_same_for_the_same_seed():
    path = arc(0.7)
    a, b = (refined("paper", FIELD, path, 0.3, np.random.default_rng(5)) for _ in range(2))
    assert np.array_equal(a, b)
    assert FIELD.distance(a)[8:-8].min() > FIELD.distance(path)[8:-8].min()


@settings(max_examples=50, deadline=None)
@given(st.floats(0.52, 2.0), st.integers(0, 100))
def test_of_random_moves_any_free_one_is_kept_or_those_away_from_solids(radius, seed):
    """By the paper's sentence each point that can move freely has moved once, by the step."""
    path, step = arc(radius), 0.03
    moved = {
        keeps: perturbed(
            FIELD, path, step, np.random.default_rng(seed), RefineParams(keeps=keeps, max_trials=30)
        )
        for keeps in ("free", "farther")
    }
    lengths = np.linalg.norm(moved["free"] - path, axis=1)
    assert np.allclose(lengths[1:-1], step)
    assert lengths[[0, -1]].tolist() == [0.0, 0.0]
    assert FIELD.distance(moved["free"]).min() > 0.0
    assert (FIELD.distance(moved["farther"]) >= FIELD.distance(path)).all()
    assert (FIELD.distance(moved["free"]) < FIELD.distance(path))[1:-1].any()


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"keeps": "any"}, "keeps: expected free or farther, got 'any'"),
        ({"max_trials": 0}, "max_trials: expected 1 or more, got 0"),
        ({"segment": 4}, "segment: expected 5 or more, got 4"),
        ({"overlap": 10}, "overlap: expected less than 10, got 10"),
        ({"max_rounds": 0}, "max_rounds: expected 1 or more, got 0"),
        ({"step_share": 0.0}, "step_share: expected more than 0, got 0.0"),
    ],
)
def test_refinement_out_of_range_is_refused(fields, said):
    with pytest.raises(InputError, match=said):
        RefineParams(**fields)


def test_smoothing_leaves_a_cubic_alone():
    u = np.linspace(0, 1, 10)
    line = np.column_stack([u, 2 * u, -u])
    assert smoothed(line) == pytest.approx(line)


@pytest.mark.parametrize("name", OMPL_PLANNERS)
def test_sampled_ways_are_free_repeatable_and_no_shorter_than_the_shortest(name):
    pytest.importorskip("ompl")
    grid = Grid(FIELD, [-3, -3, -1], [3, 3, 1], 0.2, 0.2)
    start, target = np.array([[-1.5, 0.1, 0.0]]), np.array([1.5, 0.0, 0.0])
    path, again = (SampledPaths(name, grid, target, start, 3).path(0) for _ in range(2))
    assert np.array_equal(path, again)
    assert np.array_equal(path[[0, -1]], [start[0], target])
    assert clear(FIELD, path, 0.1)
    # round a cylinder of radius 0.7: two tangents and an arc
    shortest = 2 * np.sqrt(1.5**2 - 0.7**2) + 0.7 * (np.pi - 2 * np.arccos(0.7 / 1.5))
    assert shortest - 0.06 <= polylines.length(path) < 2.5 * shortest


def test_taut_ways_have_the_closed_form():
    path = arc(1.5)
    shortest = 2 * np.sqrt(1.5**2 - 0.7**2) + 0.7 * (np.pi - 2 * np.arccos(0.7 / 1.5))
    assert polylines.length(pull_taut(FIELD, path, 0.2, 0.05)) == pytest.approx(shortest, rel=5e-3)


def test_ways_on_different_sides_of_a_post_are_told_apart():
    left, right = arc(1.0), arc(1.0) * [1, -1, 1]
    assert are_homotopic(FIELD, left, arc(1.4) * [1 / 1.4, 1.0, 1.0], 0.2)
    assert not are_homotopic(FIELD, left, right, 0.2)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (PlannerOptions(paths="straight"), "paths: expected tree, rrtstar, bitstar, prmstar"),
        (PlannerOptions(refine="polish"), "refine: expected none, paper, gradient"),
    ],
)
def test_unknown_options_are_named(options, message):
    with pytest.raises(InputError, match=message):
        make_planner("predictive", None, None, None, None, options)
