"""Legs found branch by branch are those that are pulled, or searched for, one by one."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, reject, settings
from hypothesis import strategies as st

from netsp import Circle, Polygon, Problem
from netsp.base.clock import Clock
from netsp.base.errors import InfeasibleError, LimitReachedError
from netsp.base.time_flags import NEVER
from netsp.plan.random_worlds import FAMILIES, random_world
from netsp.roadmap import taut_legs as legs_of
from netsp.roadmap.branches import OPEN
from netsp.roadmap.roadmap_policy import LegPolicy, RoadmapPolicy
from netsp.roadmap.taut import TautRoadmap
from netsp.roadmap.taut_legs import TautLegs
from netsp.roadmap.tethertree import GrowingTree

BAY = Polygon(polygon=[(2, -3), (8, -3), (8, 3), (2, 3), (2, 2), (7, 2), (7, -2), (2, -2)])

LIBRARY = Path(__file__).parent.parent / "problems" / "library"

TURNS = Problem(
    base=(0, 0), goals=[(6, 0.2), (3.0, 1.4), (-1, -3), (4.5, -3.5)], tether_length=38,
    obstacles=[
        Circle(center=(3, 0), radius=1), Polygon(polygon=[(3, -4), (4, -4), (4, -3), (3, -3)]),
    ],
)  # fmt: skip
"""Whole turns around a circle and around bare corners."""

INLETS = Problem(
    base=(0, 0), goals=[(5, 0), (6.5, 1.5), (9, 0.5), (5, 4)], tether_length=40, clearance=0.2,
    obstacles=[BAY, Circle(center=(5, 6), radius=1), Circle(center=(10, 3), radius=0.5)],
)  # fmt: skip

TOUCHING = Problem(
    base=(0, 0), goals=[(6, 0.5), (3, 5), (7, -4), (-2, 2)], tether_length=24,
    obstacles=[
        Circle(center=(3, 0), radius=1), Circle(center=(3, 2), radius=1),
        Polygon(polygon=[(3, -3), (5, -3), (5, -1), (3, -1)]),
        Polygon(polygon=[(5, -3), (6, -3), (6, -2), (5, -2)]),
    ],
)  # fmt: skip
"""Obstacles that touch, whose outlines give one path several spellings."""


def one_by_one(roadmap, legs=None):
    """(V, V) lengths of legs, each pulled or searched for by itself; inf within a goal."""
    legs = legs or roadmap.legs
    u, v = np.nonzero(roadmap.cluster[:, None] < roadmap.cluster[None])
    out = np.full((len(roadmap.cluster), len(roadmap.cluster)), np.inf)
    out[u, v] = out[v, u] = legs.pairs(u, v)
    return out


def sunk(problem, seed):
    """The same goals at heights of their own."""
    data = json.loads(problem.to_json())
    rng = np.random.default_rng(seed)
    for goal in data["goals"]:
        goal["position"][2] = float(rng.uniform(-20.0, 0.0))
    return Problem.model_validate(data)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.sampled_from(sorted(FAMILIES)), st.integers(1, 14), st.booleans())
def test_legs_of_whole_branches_are_those_pulled_one_by_one(seed, family, obstacles, deep):
    problem = random_world(
        seed, family=family, goals=5, obstacles=obstacles, tether_length=340.0
    )  # fmt: skip
    try:
        roadmap = TautRoadmap(sunk(problem, seed) if deep else problem, max_classes=300)
    except InfeasibleError:
        reject()  # a goal in the depth, out of reach
    found = roadmap.legs.lengths(np.arange(len(roadmap.cluster)))
    assert np.allclose(found, one_by_one(roadmap), rtol=1e-10, atol=1e-7)
    assert (found == found.T).all()


@pytest.mark.parametrize("problem", [TURNS, INLETS, TOUCHING], ids=["turns", "inlets", "touching"])
def test_so_are_those_around_bare_corners_in_bays_and_after_whole_turns(problem):
    roadmap = TautRoadmap(problem, max_classes=120)
    assert len(roadmap.cluster) > 10
    found = roadmap.legs.lengths(np.arange(len(roadmap.cluster)))
    assert np.allclose(found, one_by_one(roadmap), rtol=1e-10, atol=1e-9)


def test_some_of_the_vertices_have_the_legs_that_they_have_among_all():
    roadmap = TautRoadmap(random_world(7, goals=8, obstacles=12, tether_length=400.0))
    whole = roadmap.legs.lengths(np.arange(len(roadmap.cluster)))
    some = np.random.default_rng(0).permutation(len(whole))[: len(whole) // 3]
    assert np.allclose(roadmap.legs.lengths(some), whole[np.ix_(some, some)], rtol=1e-12)


def test_rounded_legs_are_hardly_shorter_and_never_longer():
    roadmap = TautRoadmap(sunk(random_world(7, goals=8, obstacles=12, tether_length=400.0), 0))
    vertices = np.arange(len(roadmap.cluster))
    exact, rounded = roadmap.legs.lengths(vertices), roadmap.legs.rounded(vertices)
    assert rounded.dtype == np.float32
    finite = np.isfinite(exact)
    assert (np.isinf(rounded) == ~finite).all()
    assert (rounded[finite] <= exact[finite]).all()
    assert np.allclose(rounded[finite], exact[finite], rtol=3e-7)


def test_legs_between_strided_vertices_are_pulled_by_the_same_kernel(monkeypatch):
    """Strided arrays are of another type, for which it would be compiled again."""
    roadmap = TautRoadmap(TURNS, max_classes=20)
    types, pull_each = set(), legs_of.pull_each

    def note(us, vs, *more):
        types.add((us.dtype, vs.dtype, us.flags.c_contiguous, vs.flags.c_contiguous))
        pull_each(us, vs, *more)

    monkeypatch.setattr(legs_of, "pull_each", note)
    u, v = np.nonzero(roadmap.cluster[:, None] < roadmap.cluster[None])
    assert not u.flags.c_contiguous
    found = roadmap.legs.pairs(u, v)
    assert types == {(np.dtype(np.int64), np.dtype(np.int64), True, True)}
    assert (found == roadmap.legs.pairs(u.copy(), v.copy())).all()


@pytest.fixture
def searches(monkeypatch):
    """How often a leg was searched for by itself."""
    seen = []
    search = TautLegs._search_leg

    def note(self, u, v, *more):
        seen.append((u, v))
        return search(self, u, v, *more)

    monkeypatch.setattr(TautLegs, "_search_leg", note)
    return seen


def nothing_pulled(branches, lengths, point, *rest):
    """The next open leg."""
    order, (i, j) = branches.order, rest[-2:]
    for a in range(i, len(order)):
        if point[order[a]] > 0:
            for b in range(j if a == i else a + 1, len(order)):
                u, v = order[a], order[b]
                if lengths.out[u, v] == OPEN and point[u] != point[v] and point[v] > 0:
                    return a, b
    return len(order), 0


def test_few_legs_tell_all(monkeypatch, searches):
    roadmap = TautRoadmap(random_world(0, goals=10, tether_length=450.0))
    vertices = np.arange(len(roadmap.cluster))
    pulled = roadmap.legs.lengths(vertices)
    assert len(vertices) > 300
    searches.clear()
    monkeypatch.setattr(legs_of, "fill", nothing_pulled)
    searched = roadmap.legs.lengths(vertices)
    assert np.allclose(pulled, searched, rtol=1e-10)
    assert len(searches) < 0.05 * len(vertices) ** 2 / 2


@pytest.fixture
def none_pulled(monkeypatch):
    """Every tether has to be searched for."""
    monkeypatch.setattr(GrowingTree, "pull", lambda self, ends, point, *_: np.arange(1, len(point)))


@pytest.mark.parametrize("together", [False, True])
def test_tethers_that_cannot_be_pulled_are_searched_for_and_grow_the_same_tree(
    searches, request, together
):
    problem = random_world(3, goals=6, obstacles=8, tether_length=330.0)
    one = TautRoadmap(problem)
    joint = LegPolicy(min_joint_searches=0 if together else len(one.cluster))
    other = TautRoadmap(problem, RoadmapPolicy(legs=joint))
    tree = one.legs._tether_tree(NEVER)
    searches.clear()
    request.getfixturevalue("none_pulled")
    same = other.legs._tether_tree(NEVER)
    assert len(searches) == (0 if together else len(one.cluster) - 1)
    assert (same.node == tree.node).all()
    assert (same.parent == tree.parent).all()
    assert np.allclose(same.length, tree.length)
    assert np.allclose(same.turned, tree.turned, atol=1e-9)
    assert np.allclose(same.slid, tree.slid, atol=1e-9)


def test_legs_among_walls_that_one_search_found_the_tethers_of(none_pulled, searches):
    problem = Problem.load(LIBRARY / "maze-30-0.json").model_copy(update={"tether_length": 330.0})
    roadmap = TautRoadmap(problem, max_classes=180)
    roadmap.legs._tether_tree(NEVER)
    assert not searches
    found = roadmap.legs.lengths(np.arange(len(roadmap.cluster)))
    assert np.allclose(found, one_by_one(roadmap), rtol=1e-10, atol=1e-7)


def test_the_tree_ends_where_the_tethers_do():
    roadmap = TautRoadmap(random_world(5, goals=8, obstacles=12, tether_length=380.0))
    tree, places = roadmap.legs._tether_tree(NEVER), roadmap.outline.places
    for v in range(1, len(roadmap.cluster)):
        bend = tree.last[v]
        assert tree.length[bend] <= roadmap.planar[v]
        if bend == 0:
            assert roadmap.planar[v] == pytest.approx(np.hypot(*places[roadmap.cluster[v]]))
        while bend > 0:
            before = tree.parent[bend]
            assert before < bend
            assert tree.length[before] < tree.length[bend]
            bend = before


def test_a_clock_that_is_up_ends_it_and_leaves_nothing_half_done():
    roadmap = TautRoadmap(random_world(0, goals=10, tether_length=450.0))
    vertices = np.arange(len(roadmap.cluster))
    for measure in (roadmap.legs.lengths, roadmap.legs.rounded):
        with pytest.raises(LimitReachedError, match="homotopy classes"):
            measure(vertices, clock=Clock(0.0))
    found = roadmap.legs.lengths(vertices, clock=Clock(60.0))
    assert np.allclose(found, one_by_one(roadmap), rtol=1e-10)
