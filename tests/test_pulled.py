"""Taut paths pulled along their words are those that a search finds."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import Circle, Polygon, Problem
from netsp.base.errors import NetspError
from netsp.hsignature import signature
from netsp.plan.random_worlds import FAMILIES, random_world
from netsp.roadmap.outline import is_free
from netsp.roadmap.paths import TautPaths
from netsp.roadmap.taut import TautRoadmap
from netsp.roadmap.taut_by_word import NOT_PULLED


def some_legs(roadmap, rng, most):
    """Pairs of vertices at different goals, at random."""
    u, v = np.nonzero(roadmap.cluster[:, None] < roadmap.cluster[None])
    chosen = rng.permutation(len(u))[:most]
    return [(int(u[k]), int(v[k])) for k in chosen]


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10_000), st.sampled_from(sorted(FAMILIES)), st.integers(1, 14))
def test_a_path_that_was_pulled_is_as_long_as_the_one_that_a_search_finds(seed, family, obstacles):
    problem = random_world(
        seed, family=family, goals=4, obstacles=obstacles, tether_length=330.0
    )  # fmt: skip
    roadmap = TautRoadmap(problem, max_classes=200)
    paths, legs = roadmap.paths, roadmap.legs
    for u, v in some_legs(roadmap, np.random.default_rng(seed), 25):
        a, b, word = int(roadmap.cluster[u]), int(roadmap.cluster[v]), legs.relative_word(u, v)
        length, edges, slid = paths._pull(a, b, word)
        if length == NOT_PULLED:
            continue
        searched, pieces = paths._search_word(a, b, word)
        assert length == pytest.approx(searched, rel=1e-9, abs=1e-7)
        # tangents of no length may be spelled in several ways; what is drawn is the path
        drawn = paths._polyline(a, b, list(zip(edges.tolist(), slid.tolist(), strict=True)))
        assert is_free(drawn, paths.outline.blockers)
        assert len(pieces) == 0 or len(drawn) >= 2


@pytest.mark.parametrize("family", sorted(FAMILIES))
def test_hardly_any_path_of_a_random_world_cannot_be_pulled(family):
    problem = random_world(2, family=family, goals=12, obstacles=16, tether_length=350.0)
    roadmap = TautRoadmap(problem, max_classes=300)
    u, v = np.nonzero(roadmap.cluster[:, None] < roadmap.cluster[None])
    lengths = roadmap.legs._pull_pairs(u, v)
    assert (lengths < 0.0).mean() < 0.02


def test_few_legs_are_those_of_all():
    roadmap = TautRoadmap(random_world(4, goals=6, obstacles=8, tether_length=330.0))
    vertices = np.arange(len(roadmap.cluster))
    whole = roadmap.legs.lengths(vertices)
    asked = np.zeros(whole.shape, dtype=bool)
    for u, v in some_legs(roadmap, np.random.default_rng(0), len(vertices)):
        asked[u, v] = True
    few = roadmap.legs.lengths(vertices, asked)
    assert np.allclose(few[asked], whole[asked], rtol=1e-12, atol=1e-9)
    assert np.isinf(few[~(asked | asked.T)]).all()


TURNS = Problem(
    base=(0, 0), goals=[(6, 0.2), (3.0, 1.4)], tether_length=60,
    obstacles=[
        Circle(center=(3, 0), radius=1), Polygon(polygon=[(3, -4), (4, -4), (4, -3), (3, -3)]),
    ],
)  # fmt: skip


@pytest.mark.parametrize("turns", [1, 2, 3, 5])
@pytest.mark.parametrize("letter", [1, -1, 2, -2])
@pytest.mark.parametrize("goal", [1, 2])
def test_whole_turns_around_circles_and_polygons_are_counted(turns, letter, goal):
    paths = TautPaths(TURNS, longest=100.0)
    word = (letter,) * turns
    length, edges, slid = paths._pull(0, goal, word)
    assert length == pytest.approx(paths._search_word(0, goal, word)[0], rel=1e-12)
    drawn = paths._polyline(0, goal, list(zip(edges.tolist(), slid.tolist(), strict=True)))
    drawn[-1] = paths.outline.places[goal]
    assert signature(drawn, paths.outline.rays) == word


def test_a_goal_straight_above_an_obstacle_is_reached_on_the_side_of_its_word():
    problem = Problem(
        base=(0, 0), goals=[(3, 8.5), (7.5, 8.5)], tether_length=17, clearance=0.1,
        obstacles=[Circle(center=(x, y), radius=0.5) for x in (3, 7.5) for y in (2.5, 7.5)],
    )  # fmt: skip
    roadmap = TautRoadmap(problem)
    u, v = np.nonzero(roadmap.cluster[:, None] < roadmap.cluster[None])
    lengths = roadmap.legs._pull_pairs(u, v)
    assert (lengths >= 0.0).all()
    for k in range(0, len(u), 1 + len(u) // 200):
        a, b = int(roadmap.cluster[u[k]]), int(roadmap.cluster[v[k]])
        word = roadmap.legs.relative_word(int(u[k]), int(v[k]))
        assert lengths[k] == pytest.approx(roadmap.paths._search_word(a, b, word)[0], rel=1e-12)


def test_lengths_in_bulk_are_those_of_single_paths_and_unknown_words_have_none():
    paths = TautPaths(TURNS, longest=100.0)
    words = [(), (1,), (-2,), (1, 1), (2, -1)]
    found = paths.lengths([0] * 5, [1, 2, 1, 2, 1], words)
    alone = [paths.length(0, b, w) for b, w in zip([1, 2, 1, 2, 1], words, strict=True)]
    assert np.allclose(found, alone, rtol=1e-12)
    assert len(paths.lengths([], [], [])) == 0
    with pytest.raises(NetspError, match="no obstacle for every letter"):
        paths.lengths([0], [1], [(3,)])
